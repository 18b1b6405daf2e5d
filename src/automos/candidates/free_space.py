"""Evidence of motion: was a point's place seen to be empty, before or after?

For every point that is neither ground nor ego body, scans from 0.2 to 8 s before and after are asked what they saw
there: through (the place was empty, so the point came or went), a hit (the place was still taken), or nothing. Short
spans tell fast things apart, long ones slow walkers and cars that wait. No single see-through counts for much; what
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

from automos.candidates.free_space_ask import Evidence, ask, partners_of
from automos.candidates.free_space_view import Lidar, Seen, learn_lidars, look, ray_steps
from automos.scan import Frames
from automos.settings import EgoBodySettings, FreeSpaceSettings, GroundSettings

_PATTERN_SCANS = 5


class FreeSpace:
    """Evidence of a whole recording: the sensor's pattern and the ego body are learnt at the start."""

    def __init__(
        self,
        frames: Frames,
        stamps: npt.NDArray[np.float64],
        settings: FreeSpaceSettings,
        ground: GroundSettings,
        ego_body: EgoBodySettings,
        threads: int = 2,
    ):
        """Learn from a few of `frames` how the sensor's rays lie and what of the vehicle they meet.

        `stamps` (N,) are the frames' times in seconds, increasing. The result does not depend on `threads`.
        """
        self.threads = threads
        self.frames, self.stamps = frames, np.asarray(stamps, np.float64)
        self.settings, self.ground = settings, ground
        spread = np.unique(np.linspace(0, len(frames) - 1, _PATTERN_SCANS).astype(int))
        self.lidars: list[Lidar] = learn_lidars(frames, [frames[i] for i in spread], ego_body, threads)
        steps = np.floor(self.stamps / settings.far_step)
        self._is_far_partner = np.concatenate([[True], np.diff(steps) > 0])

    @property
    def ray_steps(self) -> npt.NDArray[np.float64]:
        """(2,) radians between neighbouring rows and columns of rays, of the sparsest LiDAR."""
        return ray_steps(self.lidars)

    def partners(self, index: int) -> npt.NDArray[np.int64]:
        """Return the scans that are asked about scan `index`, in time order: the nearest to each span.

        Over the longer spans only scans `far_step` apart are asked, so that only their images need be kept for long.
        """
        others = partners_of(self.stamps[index], self.stamps, self._is_far_partner, self.settings)
        return np.setdiff1d(others, [index])

    def collect(self, start: int = 0, stop: int | None = None) -> Iterator[tuple[int, Evidence]]:
        """Yield (index, evidence) of every frame from `start` to before `stop`, in order; each frame is read once.

        The result does not depend on where one starts and stops.
        """
        todo = range(start, len(self.frames) if stop is None else stop)
        partners = {i: self.partners(i) for i in todo}
        last_use = np.full(len(self.frames), -1)
        for i in todo:
            last_use[[i, *partners[i]]] = i
        seen: dict[int, Future[Seen]] = {}
        asked: deque[tuple[int, Future[Evidence]]] = deque()
        with ThreadPoolExecutor(self.threads) as pool:
            for i in todo:
                ahead = min(i + 2 * self.threads, todo[-1])
                for j in (ahead, *partners[ahead], i, *partners[i]):
                    if j not in seen:
                        seen[j] = pool.submit(self._look, int(j))
                others = [seen[j].result() for j in partners[i]]
                asked.append((i, pool.submit(self._ask, i, seen[i].result(), others, partners[i])))
                if len(asked) > 2 * self.threads:
                    done, evidence = asked.popleft()
                    yield done, evidence.result()
                for j in [j for j in seen if last_use[j] <= i]:
                    del seen[j]
            while asked:
                done, evidence = asked.popleft()
                yield done, evidence.result()

    def _look(self, index: int) -> Seen:
        """Return what frame `index` saw."""
        return look(self.frames[index], self.lidars, self.ground)

    def _ask(self, index: int, mine: Seen, others: list[Seen], partners: npt.NDArray[np.int64]) -> Evidence:
        """Return what the scans `partners`, who saw `others`, say about frame `index`."""
        return ask(mine, others, self.stamps[partners] - self.stamps[index], self.settings)
