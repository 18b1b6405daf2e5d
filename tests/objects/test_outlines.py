import numpy as np
import pytest

from automos.core.upright_boxes import Boxes
from automos.objects.boxes import fit_boxes
from automos.objects.outlines import DIRECTIONS, corners, outlines


def reach(outline: np.ndarray, yaw: float) -> tuple[float, float]:
    """Return the ends of the points (K, 2) along a direction."""
    along = outline @ [np.cos(yaw), np.sin(yaw)]
    return float(along.min()), float(along.max())


@pytest.mark.parametrize("seed", range(5))
def test_an_outline_reaches_as_far_as_the_points_in_its_directions_and_nearly_in_any(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(0.0, [2.0, 0.8, 0.5], (300, 3)) + np.array([1000.0, -500.0, 2.0])
    ids = rng.integers(-1, 3, 300).astype(np.int32)
    boxes = fit_boxes(points, ids, np.ones(3))
    found = outlines(points, ids, boxes)
    for k in range(3):
        own = (points[ids == k] - boxes.center[k])[:, :2]
        for yaw in np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False):
            np.testing.assert_allclose(reach(found[k], yaw), reach(own, yaw), atol=1e-5)
        # What lies beyond the line between two of them is in the triangle to their directions.
        longest = np.linalg.norm(found[k] - np.roll(found[k], 1, axis=0), axis=1).max()
        missed = 0.5 * longest * np.tan(np.pi / DIRECTIONS) + 1e-5
        for yaw in rng.uniform(0.0, 2.0 * np.pi, 20):
            (low, high), (least, greatest) = reach(found[k], yaw), reach(own, yaw)
            assert least - 1e-5 <= low <= least + missed
            assert greatest - missed <= high <= greatest + 1e-5


def test_of_a_box_the_outline_is_its_corners():
    box = Boxes(np.array([[5.0, 1.0, 1.0]]), np.array([[4.0, 2.0, 1.5]]), np.array([0.4]), np.ones(1))
    (found,) = corners(box)
    assert reach(found, 0.4) == pytest.approx((-2.0, 2.0), abs=1e-6)
    assert reach(found, 0.4 + 0.5 * np.pi) == pytest.approx((-1.0, 1.0), abs=1e-6)
    assert len(np.unique(found.round(4), axis=0)) == 4


def test_no_segments_have_no_outlines():
    nothing = outlines(np.zeros((4, 3), np.float32), np.full(4, -1, np.int32), Boxes.empty())
    assert nothing.shape == corners(Boxes.empty()).shape == (0, DIRECTIONS, 2)
