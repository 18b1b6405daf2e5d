"""The pictures of a report, seen from above: the area of a recording, and each track at some moments of its life.

On the map, static points are grey, what moves is green, errors are red and blue. Of a track, points lie over one
another. The moments lie in the level frame, which does not move. Something parked therefore draws the same outline
again and again, and something that drives draws a row of them: whether a track moved can be seen at a glance.
"""

import base64
import io
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.arrays import some_of
from automos.core.upright_boxes import Boxes, points_in_boxes
from automos.views.topdown import FALSE, MISSED, MOVING, STATIC


def palette_png(image: npt.NDArray[np.uint8], colors: npt.NDArray[np.uint8]) -> bytes:
    """Return a PNG file of `image` (H, W) uint8, rows from the top, whose values index `colors` (K, 4) uint8 RGBA."""
    from PIL import Image

    file, picture = io.BytesIO(), Image.fromarray(np.ascontiguousarray(image))
    picture.putpalette(colors.tobytes(), "RGBA")
    picture.save(file, "PNG", optimize=True)
    return file.getvalue()


REACH = 60.0
"""Metres around the trajectory that are drawn."""
MAX_PIXELS = 1300
"""Longest side of the picture; with it the page stays small whatever the length of the drive."""
MIN_CELL = 0.1
"""Metres a pixel at least."""
LOW, HIGH = 0.3, 3.0
"""Metres above the ground from which, and up to which, what stands is drawn darker."""
BLOCK = 3.0
"""Metres, side of the squares within which the ground is taken for flat, so that a hill is not drawn as a wall."""
SHADES = 12
GROUND_GREY, DARK_GREY = 226, 92

LAYERS = {MOVING: ("moving", (10, 157, 60)), FALSE: ("false", (224, 38, 43)), MISSED: ("missed", (31, 95, 255))}
"""Layers above the grey one: their names and colours."""


class GroundMap:
    """A raster in the level frame to which scans are added one by one."""

    def __init__(self, path_level: npt.NDArray[np.float64]):
        """Cover the surroundings of `path_level` (N, 2 or 3), metres: where the sensor was."""
        low, high = path_level[:, :2].min(axis=0) - REACH, path_level[:, :2].max(axis=0) + REACH
        self.cell = max(MIN_CELL, float((high - low).max()) / MAX_PIXELS)
        self.low = low
        self.shape = tuple(int(side) for side in np.ceil((high - low) / self.cell)[::-1])
        self._seen = np.zeros(self.shape, np.int32)
        self._highest = np.full(self.shape, -np.inf, np.float32)
        self._lowest = np.full(self.shape, np.inf, np.float32)
        self._counts = {kind: np.zeros(self.shape, np.int32) for kind in LAYERS}

    def add(self, points: npt.NDArray, kinds: npt.NDArray[np.uint8]) -> None:
        """Add the points (N, 3) of a scan, level frame, metres, each with its verdict (N,).

        What is not finite or too far away is left out.
        """
        with np.errstate(invalid="ignore"):
            column, row = np.floor((points[:, :2] - self.low) / self.cell).T
            inside = (row >= 0) & (row < self.shape[0]) & (column >= 0) & (column < self.shape[1])
        kind, height = kinds[inside], points[inside, 2].astype(np.float32)
        cells = np.stack([row[inside], column[inside]]).astype(np.int64)
        for layer, count in self._counts.items():
            np.add.at(count, tuple(cells[:, kind == layer]), 1)
        is_still = kind <= STATIC
        still = tuple(cells[:, is_still])
        np.add.at(self._seen, still, 1)
        np.maximum.at(self._highest, still, height[is_still])
        np.minimum.at(self._lowest, still, height[is_still])

    def to_page(self) -> dict[str, Any]:
        """Return the layers that are not empty, lowest first, and their place: `low` (2,) and `cell`, metres."""
        layers = {"static": _picture(self._shade(), _static_colors())}
        for kind, (name, color) in LAYERS.items():
            if self._counts[kind].any():  # 1 to 4 by the number of points
                layers[name] = _picture(np.digitize(self._counts[kind], [1, 4, 16, 64]), _layer_colors(color))
        return {
            "layers": layers,
            "low": [round(float(v), 3) for v in self.low],
            "cell": self.cell,
            "width": self.shape[1],
            "height": self.shape[0],
        }

    def _shade(self) -> npt.NDArray[np.uint8]:
        """Return (H, W): 0 unseen, 1 ground, larger for higher objects."""
        tall = np.clip((self._highest - self._floor() - LOW) / (HIGH - LOW), 0.0, 1.0)
        shade = 1 + np.round(tall * (SHADES - 1)).astype(np.uint8)
        # Isolated points far away are noise that compresses badly.
        return np.where(self._seen > (self.cell > MIN_CELL), shade, 0)

    def _floor(self) -> npt.NDArray[np.float32]:
        """Return (H, W) metres, the ground's height: of each square of `BLOCK` what a quarter of its cells are below.

        Not the lowest point, which is often a reflection from under the ground.
        """
        block = max(1, round(BLOCK / self.cell))
        floor = np.zeros(self.shape, np.float32)
        for top, left in product(*(range(0, side, block) for side in self.shape)):
            square = slice(top, top + block), slice(left, left + block)
            seen = self._lowest[square][np.isfinite(self._lowest[square])]
            if len(seen):
                floor[square] = np.partition(seen, len(seen) // 4)[len(seen) // 4]
        return floor


def _picture(image: npt.NDArray, colors: npt.NDArray[np.uint8]) -> str:
    """Return `image` (H, W) with north up as the address of a picture that is part of the page itself."""
    png = palette_png(image[::-1].astype(np.uint8), colors)
    return "data:image/png;base64," + base64.b64encode(png).decode()


def _static_colors() -> npt.NDArray[np.uint8]:
    grey = np.linspace(GROUND_GREY, DARK_GREY, SHADES).round()
    opaque = np.column_stack([grey, grey + 3, grey + 6, np.full(SHADES, 255)])
    return np.vstack([np.zeros((1, 4)), opaque]).astype(np.uint8)


def _layer_colors(color: tuple[int, int, int]) -> npt.NDArray[np.uint8]:
    return np.array([[0, 0, 0, 0], *([*color, alpha] for alpha in (70, 110, 150, 190))], np.uint8)


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
            reach = 0.5 * float((high - low).max()) + 0.5 * max(boxes[0]["size"][:2]) + MARGIN
            half = float(np.clip(reach, MIN_HALF, MAX_HALF))
            self._pictures[track["id"]] = _Picture(0.5 * (low + high), half)
            moments = some_of(len(boxes), MOMENTS)
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


def thin_rows(rows: npt.NDArray, most: int) -> npt.NDArray:
    """Return at most `most` of the rows, evenly."""
    return rows if len(rows) <= most else rows[np.linspace(0, len(rows) - 1, most).astype(int)]


def picture_rows(points: npt.NDArray, center: npt.NDArray, half: float, shade: int, most: int) -> npt.NDArray[np.uint8]:
    """Return at most `most` of `points` as (M, 3) bytes: x, y on the square's grid, and `shade`."""
    points = thin_rows(points, most)
    grid = np.clip(np.round((points[:, :2] - center + half) * (GRID / (2.0 * half))), 0, GRID)
    return np.column_stack([grid, np.full(len(points), shade)]).astype(np.uint8)


def _box(box: dict[str, Any]) -> Boxes:
    center, size, yaw = (np.array([box[key]], np.float64) for key in ("center", "size", "yaw"))
    return Boxes(center, size, yaw, np.ones(1))
