"""One scan as trainers read it: points without gaps, motion-compensated, intensity from 0 to 1, a label beside each.

Trainers turn a point at the origin, or one that is not finite, into an index far outside their images. Such points are
left out of scan and labels alike. Range images are as trainers on such project them; a residual image shows for each
pixel how far the range differs from an earlier scan's, seen from now, as a share of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.arrays import evenly_spread
from automos.core.geometry import transform
from automos.core.label_files import pack
from automos.core.labels import Label
from automos.core.scan import Array, Ints, Points, Pose
from automos.results.run_files import RunFiles
from automos.writers.formats import intensity_of

IDS = {
    "universal": {Label.UNLABELED: 0, Label.STATIC: 99, Label.MOVING: 259},
    "mos": {Label.UNLABELED: 0, Label.STATIC: 9, Label.MOVING: 251},
}
"""Numbers that stand for the labels.

universal: other-object and moving-other-vehicle, which trainers of all kinds know.   mos: those of the benchmark, which
semantic trainers refuse or take for cars.
"""
_MOST_INSTANCES = 0x7FFF
"""Trainers read a label and its instance as one number of 32 bits with a sign."""
_FULL_SCALES = (1.0, 255.0, 65535.0)
"""What sensors and recorders give to the strongest return: a share, a byte, or two."""


@dataclass(frozen=True, eq=False)
class TrainingScan:
    """The M points of use of a scan.

    Attributes
    ----------
    points : (M, 4) float32
        x, y, z in metres as seen from the scan's pose, and the intensity from 0 to 1.
    labels : (M,) uint32
        Number of the label in the lower 16 bits; the object, 0 for none, in the upper ones.
    """

    points: Points
    labels: npt.NDArray[np.uint32]

    @property
    def n_moving(self) -> int:
        """Number of points that move."""
        return int(np.count_nonzero((self.labels & 0xFFFF) > 250))


def training_scan(run: RunFiles, index: int, ids: str, full_scale: float) -> TrainingScan:
    """Return scan `index` of `run` with labels numbered as `ids`, one of `IDS`.

    full_scale : the intensity that becomes 1; see `full_scale_of`.
    """
    scan = run.scan(index)
    kept = scan.is_valid
    share = np.clip(intensity_of(scan) / np.float32(full_scale), 0.0, 1.0)
    points = np.column_stack([run.points_at_pose(scan, index), share]).astype(np.float32)
    found = run.labels(index, len(scan))
    number_of = np.zeros(Label.MOVING + 1, np.uint32)
    number_of[list(IDS[ids])] = list(IDS[ids].values())
    instances = None
    if ids == "universal":  # the benchmark's labels have none: some tools compare all 32 bits with 250
        objects = run.instances(index, len(scan))
        instances = np.where(objects > 0, (objects - 1) % _MOST_INSTANCES + 1, 0)[kept]
    return TrainingScan(points[kept], pack(number_of[found[kept]], instances))


def full_scale_of(run: RunFiles) -> float:
    """Return the intensity of the strongest return that the sensor can give: 1, 255, or 65535.

    The smallest that no point of some scans, spread over the recording, is above.
    """
    shown = (run.scan(index).intensity for index in evenly_spread(range(len(run)), 20))
    highest = max((float(np.nan_to_num(each).max(initial=0.0)) for each in shown if each is not None), default=0.0)
    return next((scale for scale in _FULL_SCALES if highest <= scale), highest)


WIDTH = 2048
"""Columns of the images that all of these trainers are set up for."""
_ROWS = 16
"""Their networks halve an image four times, so its height is a multiple of this."""
_RESIDUAL_RANGE = (2.0, 50.0)
"""Metres between which they compare ranges."""

Image = npt.NDArray[np.float32]


@dataclass(frozen=True)
class ImageSensor:
    """A sensor by the range image that holds its rays: number of rows, upper and lower end in whole degrees."""

    height: int
    fov_up: int
    fov_down: int

    def is_like(self, other: ImageSensor) -> bool:
        """Return whether the two are one kind of sensor: as many rows, ends within two degrees."""
        ends = abs(self.fov_up - other.fov_up), abs(self.fov_down - other.fov_down)
        return self.height == other.height and max(ends) <= 2

    def joined(self, other: ImageSensor) -> ImageSensor:
        """Return the one that holds the rays of both."""
        return ImageSensor(self.height, max(self.fov_up, other.fov_up), min(self.fov_down, other.fov_down))

    def project(self, points: Points) -> tuple[Image, Ints]:
        """Return (height, WIDTH) ranges in metres, -1 without a return, and the row of `points` (N, 3) in each pixel.

        The nearest point of a pixel is shown; rays above or below the image are in its first or last row.
        """
        ranges = np.linalg.norm(points, axis=1)
        sine = points[:, 2] / np.maximum(ranges, np.finfo(np.float32).tiny)
        elevation = np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0)))
        u = 0.5 * (1.0 - np.arctan2(points[:, 1], points[:, 0]) / np.pi) * WIDTH
        v = (1.0 - (elevation - self.fov_down) / (self.fov_up - self.fov_down)) * self.height
        column = np.clip(np.floor(u), 0, WIDTH - 1).astype(np.int64)
        row = np.clip(np.floor(v), 0, self.height - 1).astype(np.int64)
        image, point = np.full((self.height, WIDTH), -1.0, np.float32), np.full((self.height, WIDTH), -1)
        far_first = np.argsort(-ranges, kind="stable")
        image[row[far_first], column[far_first]] = ranges[far_first]
        point[row[far_first], column[far_first]] = far_first
        return image, point


def measure_sensor(scans: Iterable[Points], n_rows: int) -> ImageSensor:
    """Return the sensor of `scans`, (N, 3) each, that has `n_rows` rows of rays.

    One point in a thousand may lie beyond its ends: what a wet road bends away.
    """
    sines = [scan[:, 2] / np.linalg.norm(scan, axis=1) for scan in scans if len(scan)]
    low, high = np.degrees(np.arcsin(np.quantile(np.concatenate(sines), [1e-3, 1.0 - 1e-3]))) if sines else (-1.0, 1.0)
    # A pattern shows the number of rows to a few in a hundred; all recordings of a sensor are to have one height.
    height = _ROWS * max((n_rows + _ROWS // 2) // _ROWS, 1)
    # The horizon is between the ends, wherever it looks: trainers add up the ends' sizes.
    return ImageSensor(height, max(int(np.ceil(high)), 0), min(int(np.floor(low)), -1))


def image_statistics(scans: Iterable[npt.NDArray[np.float32]], sensor: ImageSensor) -> Array:
    """Return (2, 5) means and deviations of range, x, y, z, intensity over the pixels of `scans`, (N, 4) each."""
    shown = []
    for scan in scans:
        _, point = sensor.project(scan[:, :3])
        pixels = scan[point[point >= 0]]
        shown.append(np.column_stack([np.linalg.norm(pixels[:, :3], axis=1), pixels]).astype(np.float64))
    rows = np.concatenate([*shown, np.zeros((0, 5))])
    if not len(rows):
        return np.stack([np.zeros(5), np.ones(5)])
    spreads = rows.std(0)
    return np.stack([rows.mean(0), np.where(spreads > 0.0, spreads, 1.0)])  # they divide by it


def residual_image(now: Points, before: Points, T_now_before: Pose, sensor: ImageSensor) -> Image:
    """Return (height, WIDTH) float32: |range now - range before| / range now, 0 where either is unknown or far.

    Parameters
    ----------
    now, before : (N, 3) and (M, 3) metres, each in its own sensor frame.
    T_now_before : (4, 4) from the earlier scan's frame to that of now.
    """
    one, other = (sensor.project(_near(points))[0] for points in (now, transform(T_now_before, before)))
    both = (one > 0.0) & (other > 0.0)
    out = np.zeros_like(one)
    out[both] = np.abs(one - other)[both] / one[both]
    return out


def _near(points: Points) -> Points:
    nearest, farthest = _RESIDUAL_RANGE
    ranges = np.linalg.norm(points, axis=1)
    return points[(ranges > nearest) & (ranges < farthest)]
