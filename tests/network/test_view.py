import numpy as np
import pytest

from automos.core.scan import Frame, Scan
from automos.network.images import thin
from automos.network.recordings import measure_view
from automos.settings import ImageSettings
from automos.simulation import simulate


def frame_of(scan: Scan) -> Frame:
    kept = np.flatnonzero(scan.is_valid)
    return Frame(scan.points[kept], kept, len(scan), np.eye(4), 0.0)


@pytest.mark.parametrize(("sensor", "size", "share"), [("OS1-64", (64, 1024), 0.98), ("VLP-16", (16, 1808), 0.95)])
def test_an_image_of_the_sensors_own_size_keeps_its_points(sensor, size, share):
    scan = simulate("waiting", sensor, n_scans=1, seed=3)[0]
    frame = frame_of(scan)
    view = measure_view([frame], [scan], ImageSettings(height=size[0], width=size[1]))
    assert len(thin(frame.points, view.grid)) >= share * len(frame.points)


def test_intensities_are_scaled_by_the_recordings_own():
    points = np.random.default_rng(0).normal(0, 10, (2000, 3)).astype(np.float32)
    intensity = np.linspace(0, 4000, 2000, dtype=np.float32)
    scan = Scan(points, intensity)
    view = measure_view([frame_of(scan)], [scan], ImageSettings(height=16, width=64))
    assert view.intensity_scale == pytest.approx(0.99 * 4000, rel=0.01)
    bare = Scan(points)
    assert measure_view([frame_of(bare)], [bare], ImageSettings(height=16, width=64)).intensity_scale == 0.0
