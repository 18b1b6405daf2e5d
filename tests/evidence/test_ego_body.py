from dataclasses import replace

import numpy as np
import pytest
from free_space_worlds import HEIGHT, REACH, ListFrames, spin
from scipy.spatial.transform import Rotation
from worlds import Block, cast, van

from automos.core.beam_pattern import Lidar, learn_pattern, make_pattern
from automos.core.geometry import inverse, make_transform
from automos.core.scan import Frame
from automos.evidence.ego_body import decide_body, find_ego_body, image_of
from automos.evidence.ground import find_ground
from automos.evidence.on_body import is_on_body
from automos.settings import CandidatesSettings, GroundSettings

BONNET = Block((1.6, 0.0, HEIGHT - 0.8), (1.0, 1.4, 0.3))  # beside a sensor at x = 0
HOUSES = tuple(Block((10.0 * k, side, 3.0), (6.0 + k % 3, 4.0, 6.0)) for k in range(-3, 8) for side in (-11.0, 12.0))


def lidar_of(frames, sample):
    """The LiDAR as learnt from the frames `sample`, with the body that all frames show."""
    pattern = learn_pattern([frames[i] for i in sample])
    lidar = Lidar(0, np.eye(4), pattern)
    return replace(lidar, body=find_ego_body(frames, frames.T_level_sensor, lidar, CandidatesSettings()))


def ground_of(frame):
    return find_ground(frame.points_level, frame.origin_level, GroundSettings())[0]


def body_points(frames, sample, truth):
    lidar = lidar_of(frames, sample)
    points = [frames[i].points for i in range(len(frames))]
    found = np.concatenate([is_on_body(p, np.zeros(len(p), bool), lidar) for p in points])
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
    found, true = body_points(frames, (0, 20), truth)
    assert true.sum() > 1000
    assert (found & true).sum() > 0.95 * true.sum()
    assert not (found & ~true).any()


def test_the_bonnet_is_found_though_others_drive_where_it_was():
    top = BONNET.center[2] + 0.5 * BONNET.size[2]
    column = tuple(Block((-9.0 - 5.0 * k, 0.0, 0.5 * top), (4.0, 1.9, top), velocity=(8.0, 0.0, 0.0)) for k in range(5))
    frames, truth = recording(speed=8.0, extra=column)
    found, true = body_points(frames, (0, 20), truth)
    assert (found & true).sum() > 0.95 * true.sum()


def test_a_vehicle_alongside_at_the_same_speed_is_no_body():
    bus = Block((0.0, 3.2, 1.5), (11.0, 2.4, 3.0), velocity=(10.0, 0.0, 0.0))  # slides past at 2 m/s
    frames, truth = recording(speed=8.0, extra=(bus,))
    found, true = body_points(frames, (0, 20), truth)
    assert not (found & ~true).any()


def test_a_lorry_that_stays_beside_the_sensor_for_long_is_no_body():
    lorry = Block(
        (0.0, 3.2, 1.5), (11.0, 2.4, 3.0), velocity=(8.0, 0.04, 0.0)
    )  # 4 cm/s off the line: who drives straighter?
    frames, truth = recording(speed=8.0, extra=(lorry,))
    found, true = body_points(frames, (0, 20), truth)
    assert not (found & ~true).any()


@pytest.mark.parametrize("seed", [0, 1])
def test_people_who_walk_around_the_sensor_do_not_make_even_ground_a_body(seed):
    # The ground keeps its range, and people before it leave their places: neither is the sensor's own.
    rng = np.random.default_rng(seed)
    people, frames = [], []
    for _ in range(6):
        when, speed = rng.uniform(0.0, 4.0), rng.uniform(-1.0, 2.0)
        beside = 2.0 * when + rng.uniform(-3.0, 3.0) - speed * when, rng.choice([-1, 1]) * rng.uniform(0.9, 3.0)
        people.append(Block((*beside, 0.85), (0.4, 0.5, 1.7), velocity=(speed, 0.0, 0.0)))
    for t in 0.1 * np.arange(40):
        frame, _, distance = spin((*HOUSES, *people), x=2.0 * t + 0.5 * np.sin(2.0 * t), time=t)
        frames.append(frame(distance))
    assert lidar_of(ListFrames(frames), (0, 20)).body is None


@pytest.mark.parametrize("gap", [0.4, 0.6])
def test_who_stands_beside_the_body_is_not_connected_to_it(gap):
    frames, _ = recording(speed=8.0)
    person = Block((1.6, 0.7 + gap + 0.2, 0.85), (0.5, 0.4, 1.7))
    _, rays, _ = spin(())
    distance, hit = cast((BONNET, person), np.array([0.0, 0.0, HEIGHT]), rays, 0.0)
    found = is_on_body((distance[:, None] * rays).astype(np.float32), hit < 0, lidar_of(frames, (0, 20)))
    assert found[hit == 0].mean() > 0.95
    assert not found[hit == 1].any()


def test_who_stands_beside_a_large_body_is_not_connected_to_it():
    # The side of a truck reaches far. Near the sensor, what is a few decimetres away from it is still another object.
    frames, _ = roundabout()
    lidar = lidar_of(frames, (0, 15, 30, 45, 59))
    assert lidar.body.reach.max() > 3.0
    _, rays, _ = spin(())
    cab, person = Block((0.2, -1.6, -0.4), (2.2, 2.4, 1.8)), Block((1.9, -0.3, -0.6), (0.4, 0.4, 1.7))
    distance, hit = cast((cab, person), np.zeros(3), rays, 0.0)
    distance, rays, hit = distance[hit >= 0], rays[hit >= 0], hit[hit >= 0]
    found = is_on_body((distance[:, None] * rays).astype(np.float32), hit < 0, lidar)
    assert (hit == 1).sum() > 20
    assert not found[hit == 1].any()


def test_a_sensor_that_stands_still_finds_no_body():
    frames, truth = recording(speed=0.0)
    found, _ = body_points(frames, (0,), truth)
    assert not found.any()


# ----------------------------------------------------------------------- what rides along, and what only keeps company
WORLD, OWN, TRAFFIC, GROUND = range(4)
STREET = tuple(Block((10.0 * k, side, 3.0), (6.0 + k % 3, 4.0, 6.0)) for k in range(-4, 16) for side in (-12.0, 13.0))
PARKED = tuple(van(9.0 * k, -6.5) for k in range(-3, 14))
HARBOUR = tuple(Block((12.0 * k, side, 1.0), (9.0 + k % 3, 4.0, 5.0)) for k in range(-4, 10) for side in (-22.0, 24.0))
QUIET_WATER = 0.01
"""Share of rays that return from it."""


def ride(n_scans, speed, turn, height, sway_deg=0.0):
    """Poses of a ride at `speed` m/s, `turn(t)` rad/s, rolling and pitching by up to `sway_deg`."""
    t = 0.1 * np.arange(n_scans)
    yaw = np.cumsum([0.1 * turn(x) for x in t])
    x, y = 0.1 * speed * np.cumsum(np.cos(yaw)), 0.1 * speed * np.cumsum(np.sin(yaw))
    sway = np.radians(sway_deg)
    angles = np.column_stack([yaw, 0.6 * sway * np.cos(1.7 * t), sway * np.sin(2.0 * t)])
    R = Rotation.from_euler("zyx", angles).as_matrix()
    return np.stack([make_transform(R[i], [x[i], y[i], height]) for i in range(n_scans)])


def scan_along(T_level_sensor, world, traffic, own, elevations_deg, n_beams, is_water=False):
    """Frames of a ride, and what each point lies on; `own(i)` gives the vehicle's parts: blocks, T_sensor_part."""
    rng = np.random.default_rng(0)
    azimuth = 2.0 * np.pi * (np.arange(360) + 0.5) / 360
    e, a = (g.ravel() for g in np.meshgrid(np.radians(np.linspace(*elevations_deg, n_beams)), azimuth))
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)
    frames, truth = [], []
    for i, T in enumerate(T_level_sensor):
        distance, hit = cast((*world, *traffic), T[:3, 3], rays @ T[:3, :3].T, 0.1 * i)
        kind = np.where(hit < 0, GROUND, np.where(hit < len(world), WORLD, TRAFFIC))
        if is_water:
            distance = np.where((hit < 0) & (rng.random(len(rays)) > QUIET_WATER), np.inf, distance)
        for block, T_sensor_part in own(i):
            near = meet(block, inverse(T_sensor_part), rays)
            kind = np.where(near < distance, OWN, kind)
            distance = np.minimum(distance, near)
        seen = distance < REACH
        points = ((distance + rng.normal(0.0, 0.02, len(rays)))[seen, None] * rays[seen]).astype(np.float32)
        frames.append(Frame(points, np.arange(len(points)), len(points), T, 0.1 * i))
        truth.append(kind[seen])
    return ListFrames(frames), truth


def meet(block, T_part_sensor, rays):
    """Ranges (R,) at which rays from the sensor meet a block of its vehicle, infinite where they do not."""
    with np.errstate(divide="ignore", invalid="ignore"):
        d = rays @ T_part_sensor[:3, :3].T
        o, half = T_part_sensor[:3, 3] - np.array(block.center), 0.5 * np.array(block.size)
        low = np.minimum((-half - o) / d, (half - o) / d).max(axis=1)
        high = np.maximum((-half - o) / d, (half - o) / d).min(axis=1)
    return np.where((low <= high) & (low > 0.15), low, np.inf)


def boat(speed=4.0):
    """A boat under way, rolling, with a ferry that comes by."""
    hull = (
        Block((2.5, 0.0, -1.6), (9.0, 2.6, 0.4)),
        Block((-3.2, 0.0, -0.9), (2.0, 1.9, 1.6)),
        Block((2.5, 1.3, -1.2), (9.0, 0.08, 0.5)),
        Block((2.5, -1.3, -1.2), (9.0, 0.08, 0.5)),
    )
    ferry = Block((30.0, -6.0, 1.0), (8.0, 2.5, 2.5), velocity=(-2.5, 0.0, 0.0))
    T = ride(60, speed, lambda t: 0.12 * np.sin(0.5 * t), 2.6, sway_deg=2.5)
    return scan_along(T, HARBOUR, (ferry,), lambda i: [(part, np.eye(4)) for part in hull], (-33, 12), 64, True)


def boat_at_its_quay():
    """The same boat, a metre in six seconds."""
    return boat(speed=0.15)


def articulated():
    """A lorry in a bend, its trailer cutting the corner, and an oncoming car."""
    T = ride(90, 8.0, lambda t: 0.5 * np.sin(2 * np.pi * (t - 2.5) / 2.2) if 2.5 < t < 4.7 else 0.0, 3.2, sway_deg=0.6)
    yaw, bend = np.arctan2(T[:, 1, 0], T[:, 0, 0]), np.zeros(90)
    for i in range(1, 90):
        bend[i] = bend[i - 1] + yaw[i] - yaw[i - 1] - 0.1 * 8.0 / 7.0 * np.sin(bend[i - 1])
    assert np.degrees(np.abs(bend).max()) > 10.0
    roof, trailer = Block((0.6, 0.0, -0.35), (1.6, 2.4, 0.3)), Block((-4.5, 0.0, 0.0), (11.0, 2.5, 3.6))

    def own(i):
        hitch = make_transform(Rotation.from_euler("z", -bend[i]).as_matrix(), [-2.8, 0.0, -1.0])
        return [(roof, np.eye(4)), (trailer, hitch)]

    oncoming = Block((20.0, 3.4, 1.0), (4.4, 1.8, 1.6), velocity=(-6.0, 0.0, 0.0))
    return scan_along(T, (*STREET, *PARKED), (oncoming,), own, (-25, 10), 40)


def roundabout():
    """A lorry whose trailer swings throughout, seen along its long side from beside the cab, and an oncoming car."""
    T, bend = ride(60, 3.0, lambda t: 0.1, 2.4, sway_deg=0.6), np.zeros(60)
    for i in range(1, 60):
        bend[i] = bend[i - 1] + 0.1 * 0.1 - 0.1 * 3.0 / 6.4 * np.sin(bend[i - 1])
    assert np.degrees(np.ptp(bend)) > 10.0
    cab, trailer = Block((0.2, -1.6, -0.4), (2.2, 2.4, 1.8)), Block((-3.8, 0.0, 0.1), (10.0, 2.5, 2.8))

    def own(i):
        hinge = make_transform(Rotation.from_euler("z", -bend[i]).as_matrix(), [-1.9, -1.6, 0.0])
        return [(cab, np.eye(4)), (trailer, hinge)]

    oncoming = Block((20.0, 5.0, 1.0), (4.4, 1.8, 1.6), velocity=(-6.0, 0.0, 0.0))
    return scan_along(T, (*STREET, *PARKED), (oncoming,), own, (-25, 10), 40)


def convoy():
    """A car among a lorry beside it, one that follows and one that leads, all at nearly its speed for six seconds."""
    bonnet, roof = Block((1.6, 0.0, -0.9), (1.0, 1.5, 0.3)), Block((0.0, 0.0, -0.35), (1.6, 1.2, 0.1))
    company = (
        Block((0.0, 3.2, 1.6), (12.0, 2.5, 3.2), velocity=(8.03, 0.03, 0.0)),
        Block((9.0, 0.0, 0.75), (4.4, 1.8, 1.5), velocity=(8.03, 0.0, 0.0)),
        Block((-8.0, 0.3, 0.75), (4.4, 1.8, 1.5), velocity=(8.05, 0.0, 0.0)),
    )
    own = [(bonnet, np.eye(4)), (roof, np.eye(4))]
    return scan_along(
        ride(60, 8.0, lambda t: 0.0, 1.8, sway_deg=0.3), (*STREET, *PARKED), company, lambda i: own, (-24, 6), 40
    )


def backpack():
    """An operator under the sensor, who sways and steps, with a companion at his side."""

    def own(i):
        sway = [0.06 * np.sin(0.9 * i), 0.05 * np.cos(1.1 * i), 0.15 * np.sin(0.9 * i)]
        shift = [0.03 * np.sin(0.5 * i), 0.03 * np.sin(0.9 * i), 0.02 * np.cos(0.7 * i)]
        torso = make_transform(Rotation.from_euler("xyz", sway).as_matrix(), shift)
        step = 0.35 * np.sin(0.9 * i)
        return [
            (Block((0.22, 0.0, -0.25), (0.2, 0.17, 0.25)), torso),
            (Block((0.15, 0.0, -0.6), (0.25, 0.5, 0.5)), torso),
            (Block((0.15 + step, 0.12, -1.4), (0.2, 0.15, 0.9)), np.eye(4)),
            (Block((0.15 - step, -0.12, -1.4), (0.2, 0.15, 0.9)), np.eye(4)),
        ]

    walls = tuple(Block((6.0 * k, side, 2.0), (4.0 + k % 2, 1.0, 4.0)) for k in range(-4, 8) for side in (-7.0, 6.0))
    companion = Block((2.0, 1.4, 0.9), (0.4, 0.5, 1.75), velocity=(1.25, 0.02, 0.0))
    T = ride(60, 1.3, lambda t: 0.3 * np.sin(0.4 * t), 2.0, sway_deg=3.0)
    return scan_along(T, walls, (companion,), own, (-55, 10), 32)


def swinging_arms():
    """An operator below the beams whose hands come into view by turns, and someone who walks by within arm's reach."""

    def own(i):
        return [
            (Block((0.55 + side * 0.4 * np.sin(0.9 * i), 0.25 * side, -0.35), (0.25, 0.1, 0.3)), np.eye(4))
            for side in (1, -1)
            if side * np.sin(0.9 * i) > 0.3
        ]

    walls = tuple(Block((6.0 * k, side, 2.0), (4.0 + k % 2, 1.0, 4.0)) for k in range(-4, 8) for side in (-7.0, 6.0))
    passer_by = Block((8.0, 1.1, 1.0), (0.4, 0.5, 2.0), velocity=(-1.2, 0.0, 0.0))
    T = ride(60, 1.3, lambda t: 0.0, 2.0, sway_deg=3.0)
    return scan_along(T, walls, (passer_by,), own, (-25, 3), 32)


def covered(frames, truth):
    """Return which points are body in every sixth scan of a ride, and what they lie on."""
    lidar, found = lidar_of(frames, (0, 15, 30, 45, 59)), []
    for i in range(0, len(frames), 6):
        found.append(is_on_body(frames[i].points, ground_of(frames[i]), lidar))
    return np.concatenate(found), np.concatenate(truth[::6])


MORE = [pytest.param(make, marks=pytest.mark.slow) for make in (boat_at_its_quay, roundabout, backpack, swinging_arms)]


@pytest.mark.parametrize("make", [boat, articulated, convoy, *MORE])
def test_what_rides_along_is_body_and_nothing_else_is(make):
    found, truth = covered(*make())
    assert found[truth == OWN].mean() > 0.995
    assert (truth == TRAFFIC).sum() > 100
    for other in (WORLD, TRAFFIC, GROUND):
        assert not found[truth == other].any()


def test_the_floor_under_a_low_sensor_is_not_its_body():
    legs = [Block((0.25, side, -0.4), (0.08, 0.08, 0.5)) for side in (-0.25, 0.25)]
    own = [(Block((-0.3, 0.0, -0.15), (0.9, 0.3, 0.12)), np.eye(4)), *((leg, np.eye(4)) for leg in legs)]
    walls = tuple(Block((6.0 * k, side, 2.0), (4.0 + k % 2, 1.0, 4.0)) for k in range(-4, 8) for side in (-7.0, 6.0))
    T = ride(60, 1.0, lambda t: 0.3 * np.sin(0.4 * t), 0.7, sway_deg=3.0)
    found, truth = covered(*scan_along(T, walls, (), lambda i: own, (-50, 20), 32))
    assert found[truth == OWN].mean() > 0.9
    assert found[truth == GROUND].mean() < 0.001


def votes_on_a_patch():
    """A patch of 6 x 10 cells, 5 m away, that may be body, and 40 reports on each of its cells: no votes."""
    pattern = make_pattern(np.radians(np.arange(-20.0, 0.0, 1.0)), np.radians(1.0))
    reach, votes = np.zeros((20, 360), np.float32), np.zeros((3, 20, 360))
    patch = slice(4, 10), slice(100, 110)
    reach[patch], votes[(0, *patch)] = 5.0, 40.0
    return pattern, reach, votes, patch


def test_scans_that_vote_have_their_own_times():
    frame, _, distance = spin(HOUSES, x=0.0, time=0.0)
    frames = [frame(distance) for _ in range(2)]
    turned = (np.arctan2(frames[0].points[:, 1], frames[0].points[:, 0]) / (2.0 * np.pi)).astype(np.float32)
    seams = [np.mod(turned - seam, np.float32(1.0)) - np.float32(0.5) for seam in (0.0, 0.4)]  # a seam that drifts
    frames = [replace(f, sweep_time=t, sweep_motion=np.zeros(6)) for f, t in zip(frames, seams, strict=True)]
    pattern = learn_pattern(frames)
    first, second = (image_of(f, f.points, pattern).pattern.sweep_time for f in frames)
    np.testing.assert_allclose(np.median(np.mod(first - second, 1.0)), 0.4, atol=0.02)


def test_a_foot_on_one_place_of_the_road_does_not_make_the_road_a_body():
    pattern, reach, votes, patch = votes_on_a_patch()
    votes[(1, *patch)] = 1.0
    votes[:, 6, 104] = 500.0, 0.0, 400.0
    assert np.argwhere(decide_body(votes, pattern, reach)).tolist() == [[6, 104]]


def test_where_nobody_votes_the_rest_of_the_part_decides():
    pattern, reach, votes, _ = votes_on_a_patch()
    votes[2, 4:6, 100:110] = 30.0
    np.testing.assert_array_equal(decide_body(votes, pattern, reach), reach > 0.0)


def test_cells_that_others_hit_often_are_world_whatever_the_rest_is():
    pattern, reach, votes, _ = votes_on_a_patch()
    votes[2, 4:10, 100:110] = 30.0
    votes[1:, 4, 100] = 20.0, 5.0
    is_body = decide_body(votes, pattern, reach)
    assert not is_body[4, 100]
    assert is_body.sum() == 59
