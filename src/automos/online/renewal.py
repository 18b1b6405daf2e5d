"""Recomputes the observations of earlier scans, a few at a time, while a corrected path catches up."""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace

from automos.core.beam_pattern import Lidar
from automos.core.scan import Frame, Pose
from automos.evidence.observations import Seen, ground_of, look
from automos.online.evidence import EvidenceWindow, as_partner
from automos.settings import GroundSettings


class Renewal:
    """Earlier scans at the poses of the new path, in the current level frame until `take_over`."""

    def __init__(self, ground: GroundSettings, pool: ThreadPoolExecutor):
        self._ground, self._pool = ground, pool
        self._futures: dict[float, Future[tuple[Frame | None, Seen, Pose]]] = {}

    def add(self, frame: Frame, lidars: list[Lidar], is_kept: bool) -> None:
        """Start recomputing the observations of `frame`; the frame itself is held if `is_kept`."""
        if lidars:
            self._futures[frame.stamp] = self._pool.submit(self._look, frame, lidars, is_kept)

    def _look(self, frame: Frame, lidars: list[Lidar], is_kept: bool) -> tuple[Frame | None, Seen, Pose]:
        seen, T = look(frame, lidars, ground_of(frame, self._ground), self._ground), frame.T_level_sensor
        return (frame, seen, T) if is_kept else (None, as_partner(seen), T)

    def take_over(self, T_after_before: Pose, window: EvidenceWindow) -> dict[float, tuple[Frame, Seen]]:
        """Put the new observations into `window`, moved by `T_after_before`; return the held frames by stamp."""
        made = {stamp: future.result() for stamp, future in self._futures.items()}
        self._futures = {}
        window.renew({stamp: (seen, T) for stamp, (_, seen, T) in made.items()}, T_after_before)
        return {
            stamp: (replace(frame, T_level_sensor=T_after_before @ frame.T_level_sensor), seen.moved(T_after_before))
            for stamp, (frame, seen, _) in made.items()
            if frame is not None
        }
