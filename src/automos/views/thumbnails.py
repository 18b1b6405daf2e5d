"""What each track looks like: its points at some moments of its life, over one another, seen from above.

The moments lie in the level frame, which does not move. Something parked therefore draws the same outline again and
again, and something that drives draws a row of them: whether a track moved can be seen at a glance.
"""

import base64
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.upright_boxes import Boxes, points_in_boxes

MOMENTS = 6
"""Scans of a track that are drawn, from its first to its last."""
POINTS, AROUND = 55, 160
"""Points drawn per moment, and of the surroundings at the middle one."""
MARGIN = 2.5
"""Metres shown around the places of the boxes."""
MIN_HALF, MAX_HALF = 4.0, 30.0
"""Metres, half the side of the square that is shown."""
GRID = 254
"""Steps a coordinate is rounded to, so that it takes a byte."""
GROUND = 0.25
"""Metres above a box's underside below which its surroundings are ground and not drawn."""


@dataclass
class _Picture:
    center: npt.NDArray[np.float64]
    half: float
    parts: list[npt.NDArray[np.uint8]] = field(default_factory=list)


class Thumbnails:
    """Collects the points of tracks in one pass over the scans."""

    def __init__(self, tracks: Iterable[dict[str, Any]]):
        """Take tracks as tracks.json has them, those to be drawn."""
        self._pictures: dict[int, _Picture] = {}
        self._wanted: dict[int, list[tuple[int, int, bool, Boxes]]] = defaultdict(list)
        for track in tracks:
            boxes = [box for box in track["boxes"] if box["observed"]] or track["boxes"]
            centers = np.array([box["center"][:2] for box in boxes])
            low, high = centers.min(axis=0), centers.max(axis=0)
            reach = 0.5 * max(float((high - low).max()), 0.0) + 0.5 * max(boxes[0]["size"][:2]) + MARGIN
            half = float(np.clip(reach, MIN_HALF, MAX_HALF))
            self._pictures[track["id"]] = _Picture(0.5 * (low + high), half)
            moments = np.unique(np.linspace(0, len(boxes) - 1, MOMENTS).round().astype(int))
            middle = moments[len(moments) // 2]
            for moment in moments.tolist():
                shade = round(moment / max(len(boxes) - 1, 1) * (MOMENTS - 1))
                box = boxes[moment]
                self._wanted[box["scan"]].append((track["id"], shade, moment == middle, _box(box)))

    @property
    def scans(self) -> set[int]:
        """Numbers of the scans that are needed."""
        return set(self._wanted)

    def add(self, scan: int, points: npt.NDArray) -> None:
        """Collect the needed points of scan number `scan`: its points (N, 3), level frame, metres."""
        wanted = self._wanted.get(scan, [])
        if wanted:
            points = points[np.argsort(points[:, 0])]  # so that each picture looks at a strip only
        for track, shade, is_middle, box in wanted:
            picture = self._pictures[track]
            half = picture.half
            strip = slice(*np.searchsorted(points[:, 0], picture.center[0] + np.array([-half, half])))
            near = points[strip][np.abs(points[strip, 1] - picture.center[1]) < half]
            inside = points_in_boxes(near, box, 0.1) >= 0
            picture.parts.append(picture_rows(near[inside], picture.center, half, shade, POINTS))
            if is_middle:
                floor = box.center[0, 2] - 0.5 * box.size[0, 2] + GROUND
                stands = ~inside & (near[:, 2] > floor) & (near[:, 2] < floor + 4.0)
                picture.parts.append(picture_rows(near[stands], picture.center, half, 255, AROUND))

    def to_page(self) -> dict[int, dict[str, Any]]:
        """Return each track's picture: bytes x, y, shade a point (base64), the middle and half the side in metres.

        x and y go from 0 to `GRID` over the square; the shade is the moment, 255 for the surroundings.
        """
        page = {}
        for track, picture in self._pictures.items():
            rows = np.concatenate([np.zeros((0, 3), np.uint8), *picture.parts])
            rows = rows[np.argsort(rows[:, 2] != 255, kind="stable")]  # surroundings below
            page[track] = {
                "points": base64.b64encode(rows.tobytes()).decode(),
                "center": picture.center.round(2).tolist(),
                "half": round(picture.half, 2),
            }
        return page


def picture_rows(points: npt.NDArray, center: npt.NDArray, half: float, shade: int, most: int) -> npt.NDArray[np.uint8]:
    """Return at most `most` of `points` as (M, 3) bytes: x, y on the square's grid, and `shade`."""
    if len(points) > most:
        points = points[np.linspace(0, len(points) - 1, most).astype(int)]
    grid = np.clip(np.round((points[:, :2] - center + half) * (GRID / (2.0 * half))), 0, GRID)
    return np.column_stack([grid, np.full(len(points), shade)]).astype(np.uint8)


def _box(box: dict[str, Any]) -> Boxes:
    center, size, yaw = (np.array([box[key]], np.float64) for key in ("center", "size", "yaw"))
    return Boxes(center, size, yaw, np.ones(1))
