"""Evidence of motion: was a point's place observed to be free, before or after?

For every point that is neither ground nor ego body, scans from 0.2 to 8 s before and after are asked what they saw
there: through (the place was free, so the point came or went), a hit (the place was still taken), or nothing. Short
spans reveal fast things, long ones slow walkers and cars that wait. No single observation counts for much; what
all spans say together does. Memory holds the scans that may still be asked, whatever the recording's length.

Rays start where their LiDAR sits. Of merged clouds each LiDAR has a pattern, a view of every scan and a say of its own;
one scan has one say: a hit by any of its LiDARs stands.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_ask import ask, partners_of
from automos.candidates.free_space_view import Seen, learn_lidars, look
from automos.scan import Frames
from automos.settings import CandidatesSettings

_PATTERN_SCANS = 5
Net = npt.NDArray[np.float32]


class FreeSpace:
    """Evidence of a whole recording: the sensor's pattern and the ego body are learnt at the start."""

    def __init__(self, frames: Frames, stamps: npt.NDArray[np.float64], settings: CandidatesSettings, threads: int = 2):
        """Learn from a few of `frames` how the sensor's rays lie and what of the vehicle they meet.

        `stamps` (N,) are the frames' times in seconds, increasing. The result does not depend on `threads`.
        """
        self.threads, self.frames, self.settings = threads, frames, settings
        self.stamps = np.asarray(stamps, np.float64)
        spread = np.unique(np.linspace(0, len(frames) - 1, _PATTERN_SCANS).astype(int))
        self.lidars = learn_lidars(frames, [frames[i] for i in spread], settings.ego_body, threads)
        steps = np.floor(self.stamps / settings.free_space.far_step)
        self._is_far_partner = np.concatenate([[True], np.diff(steps) > 0])

    def partners(self, index: int) -> npt.NDArray[np.int64]:
        """Return the scans that are asked about scan `index`, in time order."""
        return partners_of(self.stamps[index], self.stamps, self._is_far_partner, self.settings.free_space)

    def collect(self, start: int = 0, stop: int | None = None) -> Iterator[tuple[int, Seen, Net]]:
        """Yield of every frame from `start` to before `stop`, in order, its index, what it saw and `ask` of its points.

        Each frame is read once. The result does not depend on where one starts and stops.
        """
        todo = range(start, len(self.frames) if stop is None else stop)
        partners = {i: self.partners(i) for i in todo}
        last_use = np.full(len(self.frames), -1)
        for i in todo:
            last_use[[i, *partners[i]]] = i
        seen: dict[int, Future[Seen]] = {}
        asked: deque[tuple[int, Seen, Future[Net]]] = deque()
        with ThreadPoolExecutor(self.threads) as pool:
            for i in todo:
                ahead = min(i + 2 * self.threads, todo[-1])
                for j in (ahead, *partners[ahead], i, *partners[i]):
                    if j not in seen:
                        seen[j] = pool.submit(self._look, int(j))
                mine, others = seen[i].result(), [seen[j].result() for j in partners[i]]
                offsets = self.stamps[partners[i]] - self.stamps[i]
                asked.append((i, mine, pool.submit(ask, mine, others, offsets, self.settings.free_space)))
                while len(asked) > (0 if i == todo[-1] else 2 * self.threads):
                    index, about, net = asked.popleft()
                    yield index, about, net.result()
                for j in [j for j in seen if last_use[j] <= i]:
                    del seen[j]

    def _look(self, index: int) -> Seen:
        """Return what frame `index` saw."""
        return look(self.frames[index], self.lidars, self.settings.ground)
