"""Live scans in the viewer: what is logged of each, told by a file instead of a window."""

import subprocess
import sys

import numpy as np
import pytest

from automos.core.scan import Scan
from automos.views.live import LiveView

rerun = pytest.importorskip("rerun", reason="the viewer is not installed: pip install '.[view]'")

FIELDS = [("track", "i8"), ("center", "f8", 3), ("size", "f8", 3), ("yaw", "f8"), ("velocity", "f8", 3)]


class Given:
    def __init__(self, index, labels, n_objects):
        self.index, self.stamp, self.pose, self.labels = index, 10.0 + 0.1 * index, np.eye(4), labels
        self.objects = np.zeros(n_objects, FIELDS)
        self.objects["size"], self.objects["velocity"] = 1.0, [3.0, 4.0, 0.0]


class File:
    """Stands in for the viewer."""

    url = None

    def __init__(self, path):
        self.path, self.is_open = path, True

    def connect(self, stream):
        stream.save(self.path)


def test_points_boxes_and_velocities_of_every_scan_are_shown(tmp_path):
    viewer = File(tmp_path / "live.rrd")
    view = LiveView(viewer, "street", max_static=50)
    rng = np.random.default_rng(0)
    for i in range(3):
        labels = np.where(np.arange(1000) < 20, 251, 9).astype(np.uint8)
        view.show(Scan(rng.uniform(-10, 10, (1000, 3)).astype(np.float32)), Given(i, labels, n_objects=i))
    view.close()
    told = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "print", "-vvv", viewer.path], capture_output=True, text=True, check=True
    ).stdout
    for entity in ("world/points", "world/boxes", "world/velocities", "world/sensor", "curves/moving_objects"):
        assert f"/{entity}" in told
    assert "5.0 m/s" in told


def test_a_viewer_that_was_closed_is_shown_nothing(tmp_path):
    viewer = File(tmp_path / "live.rrd")
    view = LiveView(viewer, "street", max_static=50)
    viewer.is_open = False
    view.show(Scan(np.ones((2, 3), np.float32)), Given(0, np.array([9, 251], np.uint8), 0))
    view.close()
