"""Warnings say what happened, where, and only when it did."""

import numpy as np
from scipy.spatial.transform import Rotation

from automos.core.geometry import make_transform
from automos.views.caveats import caveats

N = 20
NAMES = [f"{i:06d}" for i in range(N)]
STAMPS = 0.1 * np.arange(N)
MANY = np.array([0, 1000, 10])


def poses(speed=10.0, roll=0.0):
    """Return a straight drive at `speed` m/s of a sensor rolled by degrees."""
    R = Rotation.from_euler("x", roll, degrees=True).as_matrix()
    return np.stack([make_transform(R, [speed * t, 0.0, 1.8]) for t in STAMPS])


def told(run=None, tracks=(), T=None, stamps=STAMPS, counts=MANY):
    return caveats(run or {}, list(tracks), poses() if T is None else T, stamps, NAMES, np.asarray(counts))


def test_a_clean_run_has_none():
    assert told() == []


def test_warnings_of_the_recording_and_of_odometry_come_first():
    run = {"recording": {"warnings": ["scans are missing"]}, "odometry": {"warnings": ["it drifts"]}}
    assert told(run, T=poses(roll=20.0))[:2] == ["scans are missing", "it drifts"]


def test_a_tilted_sensor_is_told_with_its_angle():
    (sentence,) = told(T=poses(roll=25.0))
    assert "tilt of 25°" in sentence
    assert told(T=poses(roll=5.0)) == []


def test_a_jump_of_the_poses_names_its_scan():
    T = poses()
    T[12:, 1, 3] += 5.0  # five metres sideways within 0.1 s
    assert told(T=T)[0].startswith("The poses jump: at scan 00001")


def test_points_without_label_and_nothing_moving_are_told():
    unlabeled, still = told(counts=[500, 500, 0])
    assert unlabeled.startswith("50 % of the points have no label")
    assert still.startswith("Nothing was found to move")


def test_moving_objects_of_little_confidence_are_counted():
    tracks = [{"verdict": "moving", "confidence": c} for c in (0.6, 0.65, 0.9)]
    (sentence,) = told(tracks=tracks)
    assert sentence.startswith("2 moving objects are judged with a confidence below 0.7")
