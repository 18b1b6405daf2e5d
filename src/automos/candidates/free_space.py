"""Evidence of motion: was a point's place observed free, before or after?

For every point that is neither ground nor ego body, scans from 0.2 to 8 s before and after report on its place:
observed free (so the point came or went), hit (so the place was still occupied), or nothing. Short spans reveal fast
objects, long ones slow walkers and cars that wait. No single observation decides; the sum over all spans does. Memory
holds only the scans that may still be asked, whatever the length of the recording.

Rays start at their LiDAR. In merged clouds each LiDAR has its own pattern, view and report on every point. These are
combined into one report per scan, in which a hit by any LiDAR prevails.
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
    """Evidence for a whole recording; the sensor's pattern and the ego body are learnt at the start."""

    def __init__(self, frames: Frames, stamps: npt.NDArray[np.float64], settings: CandidatesSettings, threads: int = 2):
        """Learn the beam pattern from a few of `frames`, and the ego body from `frames`.

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
        """Yield index, observations and evidence (`ask`) of each frame from `start` to before `stop`, in order.

        Each frame is read once. The result does not depend on `start` and `stop`.
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
        """Return the observations of frame `index`."""
        return look(self.frames[index], self.lidars, self.settings.ground)
