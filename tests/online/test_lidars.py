from dataclasses import replace

import numpy as np
import pytest

from automos import load_settings
from automos.core.beam_pattern import is_known, ray_steps
from automos.core.geometry import make_transform
from automos.core.scan import Frame
from automos.evidence.ego_body import MIN_SCANS
from automos.odometry.background import DELAY
from automos.online import lidars
from automos.online.lidars import LidarLearner

SETTINGS = load_settings("default").candidates
MOUNTS = np.stack([np.eye(4), make_transform(np.eye(3), [1.0, 0.0, 0.0])])


def merged(stamp: float, *steps_deg: float | None) -> Frame:
    """Return a frame of two LiDARs of 16 beams with so many degrees between columns; None: without points."""
    points, sensor = [np.zeros((0, 3))], [np.zeros(0)]
    for k, step in enumerate(steps_deg):
        if step is not None:
            e, a = np.meshgrid(np.radians(np.linspace(-15.0, 15.0, 16)), np.radians(np.arange(-180.0, 180.0, step)))
            rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=2).reshape(-1, 3)
            ranges = np.random.default_rng(k).uniform(5.0, 50.0, (len(rays), 1))
            points.append(ranges * rays + MOUNTS[k, :3, 3])
            sensor.append(np.full(len(rays), k))
    cloud, who = np.concatenate(points).astype(np.float32), np.concatenate(sensor).astype(np.uint8)
    T = make_transform(np.eye(3), [10.0 * stamp, 0.0, 1.8])
    return Frame(cloud, np.arange(len(cloud)), len(cloud), T, stamp, sensor=who, T_scan_sensor=MOUNTS)


def test_a_lidar_that_begins_late_gets_its_pattern_when_it_has_points():
    learner = LidarLearner(SETTINGS)
    learner.add(merged(0.0, 0.2, None))
    first, second = learner.lidars
    assert is_known(first.pattern)
    assert not is_known(second.pattern)
    np.testing.assert_array_equal(ray_steps(learner.lidars), ray_steps([first]))  # segments as without the second
    learner.add(merged(0.1, 0.2, None))
    assert learner.lidars[1].pattern is second.pattern
    learner.add(merged(0.2, 0.4, 0.4))
    assert learner.lidars[0] is first
    assert learner.lidars[1].pattern.column_width == pytest.approx(np.radians(0.4), rel=0.02)
    assert ray_steps(learner.lidars)[1] == pytest.approx(np.radians(0.4), rel=0.02)


def test_a_body_that_was_found_in_a_grid_is_not_taken_over_into_another(monkeypatch):
    monkeypatch.setattr(lidars, "with_body", lambda now, *_: [replace(lidar, body=lidar.number) for lidar in now])
    learner = LidarLearner(SETTINGS)
    for k in range(MIN_SCANS + 2):
        learner.add(merged(0.1 * k, 0.2, None))
    learner.add(merged(1.2, 0.2, 0.4))
    learner.add(merged(1.2 + DELAY, 0.2, 0.4))
    assert [lidar.body for lidar in learner.lidars] == [0, None]


def test_a_search_for_the_body_on_outdated_poses_is_dropped_and_the_next_is_not_late(monkeypatch):
    searched = []

    def found(now, frames, *_):
        searched.append(frames[0].stamp)
        return [replace(lidar, body=frames[0].stamp) for lidar in now]

    monkeypatch.setattr(lidars, "with_body", found)
    learner = LidarLearner(SETTINGS)
    for k in range(MIN_SCANS + 2):  # one for the pattern, the others for the body
        learner.add(merged(0.1 * k, 0.2, 0.2))
    learner.forget_poses()
    for k in range(MIN_SCANS + 2, 2 * MIN_SCANS + 3):
        learner.add(merged(0.1 * k, 0.2, 0.2))
        assert learner.lidars[0].body is None
    begin, end = 0.1 * (MIN_SCANS + 2), 0.1 * (2 * MIN_SCANS + 2)
    learner.add(merged(end + DELAY - 0.05, 0.2, 0.2))
    assert learner.lidars[0].body is None
    learner.add(merged(end + DELAY, 0.2, 0.2))
    assert learner.lidars[0].body == pytest.approx(begin)
    np.testing.assert_allclose(sorted(searched), [0.1, begin])
