import numpy as np
from free_space_worlds import HEIGHT, REACH, ListFrames, spin
from worlds import Block, cast

from automos.candidates.ego_body import find_ego_body
from automos.candidates.free_space_pattern import learn_pattern
from automos.settings import EgoBodySettings, GroundSettings

BONNET = Block((1.6, 0.0, HEIGHT - 0.8), (1.0, 1.4, 0.3))  # beside a sensor at x = 0
HOUSES = tuple(Block((10.0 * k, side, 3.0), (6.0 + k % 3, 4.0, 6.0)) for k in range(-3, 8) for side in (-11.0, 12.0))


def body_points(frames, pattern, truth):
    body = find_ego_body(frames, pattern, EgoBodySettings(), GroundSettings())
    found = np.concatenate([body.covers(frames[i].points) for i in range(len(frames))])
    return found, np.concatenate(truth)


def recording(speed, extra=(), n_scans=40):
    """Frames of a drive with a bonnet in sight, and which of their points lie on it."""
    frames, truth = [], []
    for i in range(n_scans):
        frame, rays, distance = spin((*HOUSES, *extra), x=0.1 * speed * i, time=0.1 * i)
        own, hit = cast((BONNET,), np.array([0.0, 0.0, HEIGHT]), rays, 0.0)
        is_body = (hit == 0) & (own < distance)
        ranges = np.where(is_body, own, distance)
        frames.append(frame(ranges))
        truth.append(is_body[ranges < REACH])
    return ListFrames(frames), truth


def test_the_bonnet_is_found_and_nothing_else():
    frames, truth = recording(speed=8.0)
    found, true = body_points(frames, learn_pattern([frames[0], frames[20]]), truth)
    assert true.sum() > 1000
    assert (found & true).sum() > 0.95 * true.sum()
    assert not (found & ~true).any()


def test_a_vehicle_alongside_at_the_same_speed_is_no_body():
    bus = Block((0.0, 3.2, 1.5), (11.0, 2.4, 3.0), velocity=(10.0, 0.0, 0.0))  # slides past at 2 m/s
    frames, truth = recording(speed=8.0, extra=(bus,))
    found, true = body_points(frames, learn_pattern([frames[0], frames[20]]), truth)
    assert not (found & ~true).any()


def test_a_lorry_that_stays_beside_the_sensor_for_long_is_no_body():
    lorry = Block(
        (0.0, 3.2, 1.5), (11.0, 2.4, 3.0), velocity=(8.0, 0.04, 0.0)
    )  # 4 cm/s off the line: who drives straighter?
    frames, truth = recording(speed=8.0, extra=(lorry,))
    found, true = body_points(frames, learn_pattern([frames[0], frames[20]]), truth)
    assert not (found & ~true).any()


def test_a_sensor_that_stands_still_finds_no_body():
    frames, truth = recording(speed=0.0)
    found, _ = body_points(frames, learn_pattern([frames[0]]), truth)
    assert not found.any()
