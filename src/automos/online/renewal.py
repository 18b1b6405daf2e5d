"""Computes the evidence of earlier scans again, a few at a time, after the path of the sensor was corrected."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace

from automos.candidates.free_space_view import Lidar, Seen, look
from automos.online.evidence import EvidenceWindow, as_partner
from automos.scan import Frame, Pose
from automos.settings import GroundSettings


class Renewal:
    """Earlier scans at the poses of the new path, in the level frame as it is until they are taken over."""

    def __init__(self, ground: GroundSettings, pool: ThreadPoolExecutor):
        self._ground, self._pool = ground, pool
        self._asked: dict[float, Future[tuple[Frame | None, Seen]]] = {}

    def add(self, frame: Frame, lidars: list[Lidar], is_kept: bool) -> None:
        """Begin to make anew what `frame` saw; the frame itself is kept where it will be asked for."""
        if lidars:
            self._asked[frame.stamp] = self._pool.submit(self._look, frame, lidars, is_kept)

    def _look(self, frame: Frame, lidars: list[Lidar], is_kept: bool) -> tuple[Frame | None, Seen]:
        seen = look(frame, lidars, self._ground)
        return (frame, seen) if is_kept else (None, as_partner(seen))

    def take_over(self, T_after_before: Pose, window: EvidenceWindow) -> dict[float, tuple[Frame, Seen]]:
        """Put what was made again into `window`, all moved by (4, 4); return the frames that were kept, by stamp."""
        made = {stamp: asked.result() for stamp, asked in self._asked.items()}
        self._asked = {}
        window.renew({stamp: seen for stamp, (_, seen) in made.items()}, T_after_before)
        return {
            stamp: (replace(frame, T_level_sensor=T_after_before @ frame.T_level_sensor), seen.moved(T_after_before))
            for stamp, (frame, seen) in made.items()
            if frame is not None
        }
