import numpy as np
import pytest

from automos.core.scan import Frame, Scan
from automos.network.images import thin
from automos.network.recordings import measure_grid
from automos.settings import ImageSettings
from automos.simulation import simulate


def frame_of(scan: Scan) -> Frame:
    kept = np.flatnonzero(scan.is_valid)
    return Frame(scan.points[kept], kept, len(scan), np.eye(4), 0.0)


@pytest.mark.parametrize(("sensor", "size", "share"), [("OS1-64", (64, 1024), 0.98), ("VLP-16", (16, 1808), 0.95)])
def test_an_image_of_the_sensors_own_size_keeps_its_points(sensor, size, share):
    scan = simulate("waiting", sensor, n_scans=1, seed=3)[0]
    frame = frame_of(scan)
    grid = measure_grid([frame], ImageSettings(height=size[0], width=size[1]))
    assert len(thin(frame.points, grid)) >= share * len(frame.points)
