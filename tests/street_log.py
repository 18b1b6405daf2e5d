"""A street with known traffic, as the recordings of the test-only writers: what a sensor saw, where, and the boxes."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from worlds import ROADSIDE, TRAFFIC, drive, record

from automos.core.geometry import inverse, transform
from automos.core.scan import Pose, Scan
from automos.core.upright_boxes import Boxes, points_in_boxes

START = 1_500_000_000.0
"""Seconds since 1970 of the first scan."""
OBJECTS = (*(block for block in ROADSIDE if block.size[0] < 5.0 and block.size[2] < 3.0), *TRAFFIC)
"""What annotators would draw boxes around: vans and cyclists."""


@dataclass(frozen=True)
class StreetLog:
    """Scans with intensity (whole numbers 0..255), time and ring; the truth of each of their points.

    T_ground_sensor : (N, 4, 4); the ground is at z = 0.
    """

    scans: list[Scan]
    truth: list[np.ndarray]
    T_ground_sensor: Pose

    @property
    def stamps(self) -> np.ndarray:
        return np.array([scan.stamp for scan in self.scans])

    @property
    def nanoseconds(self) -> np.ndarray:
        return np.round(1e9 * self.stamps).astype(np.int64)

    @property
    def poses(self) -> Pose:
        """(N, 4, 4) T_world_sensor."""
        return inverse(self.T_ground_sensor[0]) @ self.T_ground_sensor

    def boxes(self, index: int) -> Boxes:
        """Return all objects' boxes at the time of a scan, in the ground frame."""
        center = [np.array(o.center) + 0.1 * index * np.array(o.velocity) for o in OBJECTS]
        yaw = np.array([o.yaw for o in OBJECTS])
        size = np.array([o.size for o in OBJECTS], float) + 0.1  # range noise is 1 cm, and annotators leave some room
        return Boxes(np.array(center), size, yaw, np.ones(len(OBJECTS)))


@lru_cache(maxsize=1)
def street_log(n_scans: int = 12) -> StreetLog:
    """Return the street, `n_scans` at 10 Hz; its z-axis is upright, and it drives a curve at 1 m/s."""
    T_ground_sensor = drive(n_scans, turn=0.2)
    world = record((*ROADSIDE, *TRAFFIC), T_ground_sensor)
    rng = np.random.default_rng(3)
    scans = []
    for i, scan in enumerate(world.sequence):
        n = len(scan)
        scans.append(
            Scan(
                scan.points,
                intensity=rng.integers(0, 256, n).astype(np.float32),
                time=np.linspace(0.0, 0.0999, n).astype(np.float32),
                ring=(np.arange(n) * 24 // n).astype(np.uint16),
                stamp=START + 0.1 * i,
                name=f"{i:06d}",
            )
        )
    return StreetLog(scans, world.truth, T_ground_sensor)


def assert_same_points(got: Scan, true: Scan, atol: float = 1e-4) -> None:
    """Assert that a scan has the same points in the same order, and times, rings and intensities where it has any."""
    assert len(got) == len(true)
    np.testing.assert_allclose(got.points, true.points, atol=atol)
    if got.time is not None:
        np.testing.assert_allclose(got.time, true.time - true.time.min(), atol=2e-6)
    if got.ring is not None:
        np.testing.assert_array_equal(got.ring, true.ring)
    if got.intensity is not None:
        np.testing.assert_allclose(got.intensity, true.intensity, atol=1e-3)


def assert_same_truth(labels: np.ndarray, true: np.ndarray, least_told: float = 0.8) -> None:
    """Assert that labels made of boxes contradict the truth nowhere, and tell most of the moving points."""
    told = (labels & 0xFFFF) != 0
    np.testing.assert_array_equal((labels & 0xFFFF)[told], true[told])
    assert told[true == 251].mean() > least_told
    assert told.mean() > 0.9


def assert_points_lie_in_their_boxes(sequence, index):
    """Assert that the points of each true object lie in the true box of its id."""
    truth, points = sequence.truth(index), sequence[index].points.astype(np.float64)
    ids, boxes, T_boxes_sensor = sequence.truth_boxes(index)
    found = np.unique(truth >> 16)
    assert set(found[found > 0]) <= set(ids.tolist())
    for row, one in enumerate(ids.tolist()):
        on_it = transform(T_boxes_sensor, points[truth >> 16 == one])
        assert (points_in_boxes(on_it, boxes[np.array([row])], 0.01) == 0).all()
