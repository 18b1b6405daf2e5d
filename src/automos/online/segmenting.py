"""The per-scan part of the method: evidence and segments.

A scan is processed twice. When it arrives, the evidence is based on past scans only; once later scans have observed its
surroundings, the evidence is computed again. Without a lag, only the first pass is done. Neither needs the tracks, so
the next scan can be segmented while the objects of the last one are tracked.
"""

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from automos.core.beam_pattern import Lidar, ray_steps
from automos.core.geometry import inverse
from automos.core.scan import Frame, Pose, Scan
from automos.core.stages import Arrays
from automos.evidence.observations import Seen
from automos.evidence.stage import candidates_of
from automos.objects.detect import recount
from automos.objects.detections import Detections
from automos.objects.instances import segment_frame
from automos.online.evidence import EvidenceWindow
from automos.online.following import FEW, GROWN, Found
from automos.online.renewal import Renewal
from automos.online.sighting import Sighting, Sightings
from automos.settings import Settings


@dataclass(eq=False)
class SegmentedScan:
    """A scan: its points, and the arrays of the stages before the tracker, None if unavailable.

    It is held until it is returned and its evidence is complete; what follows after `segments` is of that time.
    """

    number: int
    stamp: float
    frame: Frame
    about: Arrays | None = None
    segments: Arrays | None = None
    seen: Seen | None = None
    n_compared: int = 0
    is_settled: bool = False
    is_half_grown: bool = False
    T_moved: Pose = field(default_factory=partial(np.eye, 4))  # of its places, since its segments were found

    def found(self, is_far: bool) -> Found:
        """Return its segments, with whether it was compared with scans a second or more away."""
        segments = Detections.from_arrays(self.segments or {}).moved(self.T_moved)
        return Found(self.stamp, segments, is_far)


@dataclass(frozen=True, eq=False)
class Segmented:
    """The results that a new scan completes.

    Attributes
    ----------
    renewed : list[Future[Found]]
        Segments of earlier scans with updated evidence.
    settled : list of Found
        Final segments, scan by scan.
    ahead : list of Found
        Preliminary segments of the scans after those.
    due : list of SegmentedScan
        The scans whose lag has passed.
    moved : dict[float, (4, 4) float64]
        By stamp, how places of earlier scans moved in the level frame, as their path was replaced.
    """

    renewed: list[Future[Found]]
    settled: list[Found]
    ahead: list[Found]
    due: list[SegmentedScan]
    moved: dict[float, Pose] = field(default_factory=dict)


class Segmenting:
    """The evidence and the segments of a stream of scans."""

    def __init__(self, settings: Settings, lag: float, pool: ThreadPoolExecutor, sightings: Sightings):
        """Take the arguments of `Stream`, and what gives the sightings of its scans."""
        self._settings, self._lag, self._pool, self._sightings = settings, lag, pool, sightings
        self._settle = min(lag, GROWN)
        self._window = EvidenceWindow(settings.candidates.free_space)
        self._renewal = Renewal(settings.candidates.ground, pool)
        self._held: deque[SegmentedScan] = deque()
        self._growing: deque[SegmentedScan] = deque()
        self._doubted: deque[SegmentedScan] = deque()
        self._start = np.inf
        self._lidars: list[Lidar] = []

    def step(self, number: int, scan: Scan) -> Segmented:
        """Return the results that `scan`, number `number`, completes; it has points and a stamp."""
        renewed = self._update_grown(scan.stamp)
        sighted = self._sightings.step(scan)
        self._start = min(self._start, sighted.stamp)
        moved = self._renew(sighted)
        self._place(sighted.refined)
        held = SegmentedScan(number, sighted.stamp, sighted.frame, seen=sighted.seen)
        self._held.append(held)
        self._lidars = sighted.lidars
        if held.seen is not None:
            self._window.add(held.stamp, held.seen, held.frame.T_level_sensor, sighted.doubt)
        self._find_segments(held)
        renewed += self._update_doubted()
        return replace(self._release(held.stamp, renewed), moved=moved)

    def finish(self) -> Segmented:
        """Return the remaining results."""
        return self._release(np.inf, []) if self._held else Segmented([], [], [], [])

    def _renew(self, sighted: Sighting) -> dict[float, Pose]:
        """Recompute the observations of earlier scans while a new path catches up; use them once it has.

        Returns how places of these scans move, by stamp, see `Segmented`.
        """
        for frame in sighted.again:
            is_held = any(held.stamp == frame.stamp for held in (*self._held, *self._growing))
            self._renewal.add(frame, self._lidars, is_held)
        if sighted.T_after_before is None:
            return {}
        before = self._window.poses
        frames = self._renewal.take_over(sighted.T_after_before, self._window)
        moved = {stamp: T @ inverse(before[stamp]) for stamp, T in self._window.poses.items()}
        for held in (*self._held, *self._growing):
            if held.stamp in frames:
                held.frame, held.seen = frames[held.stamp]
            held.T_moved = moved.get(held.stamp, np.eye(4)) @ held.T_moved
        self._doubted = deque(self._growing)
        for held in self._held:
            if not held.is_settled and held.segments is not None:
                self._find_segments(held)
        return moved

    def _place(self, poses: dict[float, Pose]) -> None:
        """Move the last scans to their refined poses."""
        self._window.place(poses)
        for held in (*self._held, *self._growing):
            if (T := poses.get(held.stamp)) is not None:
                change = T @ inverse(held.frame.T_level_sensor)
                held.frame = replace(held.frame, T_level_sensor=T)
                held.seen = None if held.seen is None else held.seen.moved(change)

    def _update_grown(self, now: float | None) -> list[Future[Found]]:
        """Update the evidence of earlier scans in the background: halfway, and when it is complete."""
        renewed: list[Future[Found]] = []
        if now is None:
            return renewed
        for held in self._growing:
            if not held.is_half_grown and held.stamp <= now - 0.5 * GROWN:
                held.is_half_grown = True
                renewed += self._start_update(held, self._is_far(held))
        while self._growing and self._growing[0].stamp <= now - GROWN:
            held = self._growing.popleft()
            renewed += self._start_update(held, True)
        return renewed

    def _update_doubted(self) -> list[Future[Found]]:
        """Update the evidence of the last scans if it was based on few scans or on outdated poses."""
        n, renewed = len(self._window) - 1, []
        few = [held for held in self._growing if held.n_compared < min(FEW, n)]
        doubted = [self._doubted.popleft() for _ in range(min(FEW, len(self._doubted)))]
        for held in few or doubted:
            held.n_compared = n
            renewed += self._start_update(held, self._is_far(held))
        return renewed

    def _start_update(self, held: SegmentedScan, is_far: bool) -> list[Future[Found]]:
        if held.seen is None or held.segments is None:
            return []
        compare, found = self._window.comparison(held.stamp, held.seen), held.found(is_far)

        def recounted(segments: Arrays = held.segments) -> Found:
            ids, stayed, about = segments["ids"], segments["stayed"], self._settings.instances.components
            return found._replace(segments=recount(found.segments, ids, stayed, compare(None), about))

        return [self._pool.submit(recounted)]

    def _is_far(self, held: SegmentedScan) -> bool:
        """Whether a scan is compared with scans a second or more away."""
        return self._settle > 0.0 or held.stamp - self._start >= GROWN

    def _find_segments(self, held: SegmentedScan) -> None:
        """Compute the scan's evidence and segments from all scans in the window."""
        if held.seen is None:
            return
        held.n_compared = len(self._window) - 1
        net, seen = self._window.comparison(held.stamp, held.seen)(self._pool), held.seen
        held.about = candidates_of(net, seen.kind, seen.height, seen.solidity, ray_steps(self._lidars))
        held.segments = segment_frame(self._settings.instances, (held.frame, held.about))
        held.T_moved = np.eye(4)

    def _release(self, now: float, renewed: list[Future[Found]]) -> Segmented:
        """Return the results that are final or due at `now`, seconds, and drop data no longer needed."""
        settled = [found for held in self._held if not held.is_settled for found in self._settled(held, now)]
        ahead = [h.found(is_far=False) for h in self._held if not h.is_settled and h.segments is not None]
        due = []
        while self._held and self._held[0].stamp <= now - self._lag + 1e-6:
            held = self._held.popleft()
            due.append(replace(held))  # a copy: while it is painted, its evidence may grow
        self._window.forget(min([now, *(held.stamp for held in (*self._held, *self._growing))]))
        return Segmented(renewed, settled, ahead, due)

    def _settled(self, held: SegmentedScan, now: float) -> list[Found]:
        """Return the segments of a scan once they are final, recomputed with later scans if there is a lag."""
        if held.stamp > now - self._settle + 1e-6:
            return []
        held.is_settled = True
        if self._settle > 0.0:
            self._find_segments(held)
        if held.segments is None:
            return []
        if self._settle < GROWN:
            held.is_half_grown = self._settle >= 0.5 * GROWN  # it was computed anew just now
            self._growing.append(held)
        return [held.found(self._is_far(held))]
