"""Evidence of a stream: where its poses may be off, rays must go on farther behind a place to see through it."""

from dataclasses import replace

import numpy as np
import pytest
from free_space_worlds import watch, within
from worlds import Block, van

from automos.core.geometry import make_transform
from automos.evidence.free_space import learn_lidars
from automos.evidence.observations import ground_of, look
from automos.online.evidence import EvidenceWindow
from automos.settings import CandidatesSettings

PARKED = van(6.0, -6.0)
CAR = van(-8.0, 5.0, speed=8.0)
WALLS = (Block((10.0, 14.0, 3.0), (80.0, 1.0, 6.0)), Block((45.0, 0.0, 4.0), (2.0, 60.0, 8.0)))
ABOUT = CandidatesSettings()
LAST = 12


def off_by(metres):
    """The scans of a stream whose last pose is off by so many metres, along the way and across."""
    frames = watch((*WALLS, PARKED, CAR))
    made = [frames[i] for i in range(LAST + 1)]
    off = make_transform(np.eye(3), [metres, metres, 0.0])
    made[LAST] = replace(made[LAST], T_level_sensor=off @ made[LAST].T_level_sensor)
    return made


def moved(frames, block, doubt):
    """The share of the points on `block` in the last scan that has moved, and how many these are."""
    lidars = learn_lidars([frames[k] for k in range(0, LAST, 3)])
    window = EvidenceWindow(ABOUT.free_space)
    for frame in frames:
        seen = look(frame, lidars, ground_of(frame, ABOUT.ground), ABOUT.ground)
        window.add(frame.stamp, seen, frame.T_level_sensor, doubt)
    net = window.comparison(frames[-1].stamp, seen)(None)
    truly = watch((*WALLS, PARKED, CAR))[LAST]
    is_there = within(truly, block, truly.stamp)
    return (net[is_there] >= 1.0).mean(), is_there.sum()


@pytest.fixture(scope="module")
def lost():
    return off_by(0.4)


DOUBT = np.array([0.1, 0.1, 0.0, 0.0, 0.0, 0.0])


def test_what_stands_seems_to_move_where_a_pose_is_off_and_nobody_says_so(lost):
    share, n = moved(lost, PARKED, np.zeros(6))
    assert n > 1000
    assert share > 0.8


def test_what_stands_stays_where_the_pose_is_known_to_be_off(lost):
    share, _ = moved(lost, PARKED, DOUBT)
    assert share < 0.2  # its edges, which rays pass


def test_what_drives_past_has_moved_whatever_the_doubt(lost):
    share, n = moved(lost, CAR, DOUBT)
    assert n > 1000
    assert share > 0.9
