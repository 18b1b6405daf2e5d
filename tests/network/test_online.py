import numpy as np
import pytest
from labelled_worlds import changes_move, settings
from worlds import iou_of_moving, lane, street

from automos.core.labels import Label
from automos.core.scan import Scan
from automos.network.online import STAGES, OnlineSegmenter
from automos.odometry.sweep_timing import SweepTiming
from automos.simulation import simulate
from automos.simulation.sequence import SimulatedSequence


def labels_of(scans, **kwargs) -> list[np.ndarray]:
    segmenter = OnlineSegmenter(changes_move(), settings(), **kwargs)
    return [segmenter.step(scan) for scan in scans]


@pytest.fixture(scope="module")
def city() -> SimulatedSequence:
    """Return a drive that is long enough for the timing of its sweeps to be found out on the way."""
    return simulate("city", "VLP-16", n_scans=24, seed=3)


@pytest.fixture(scope="module")
def scans(city) -> list[Scan]:
    """Return raw sweeps of a moving sensor."""
    return [Scan(scan.points, scan.intensity, stamp=scan.stamp) for scan in city]


@pytest.mark.slow
def test_later_scans_change_no_earlier_label(scans):
    online = settings().model_copy(update={"odometry": settings().odometry.model_copy(update={"time": "auto"})})

    def run(some: list[Scan]) -> list[np.ndarray]:
        segmenter = OnlineSegmenter(changes_move(), online)
        return [segmenter.step(scan) for scan in some]

    whole = run(scans)
    other_end = [*scans[:12], *scans[:12][::-1]]
    for changed in (scans[:12], other_end):
        for before, after in zip(whole[:12], run(changed)[:12], strict=True):
            assert np.array_equal(before, after)


def test_every_point_gets_a_label_in_its_order_and_none_gets_zero():
    world = lane(6)
    broken = []
    for scan in world.sequence:
        points = scan.points.copy()
        points[5], points[9] = np.nan, 0.0
        broken.append(Scan(points, stamp=scan.stamp))
    for scan, labels in zip(broken, labels_of(broken), strict=True):
        assert len(labels) == len(scan)
        assert labels[[5, 9]].tolist() == [Label.UNLABELED] * 2
        assert set(np.unique(np.delete(labels, [5, 9]))) <= {Label.STATIC, Label.MOVING}


def test_riders_are_found_by_their_residuals_while_the_sensor_moves():
    world = street(12)
    found = labels_of(world.sequence, is_compensated=True)
    # a threshold on coarse residuals is not a network: far better than chance is all that is asked
    assert iou_of_moving(found[4:], world.truth[4:]) > 0.4
    assert np.mean(np.concatenate(world.truth) == Label.MOVING) < 0.1


def test_shuffled_points_have_shuffled_labels():
    world = lane(6)
    order = [np.random.default_rng(i).permutation(len(scan)) for i, scan in enumerate(world.sequence)]
    shuffled = [Scan(scan.points[p], stamp=scan.stamp) for scan, p in zip(world.sequence, order, strict=True)]
    same = sum((a[p] == b).sum() for a, b, p in zip(labels_of(world.sequence), labels_of(shuffled), order, strict=True))
    # registration thins points in their order, so poses differ by about a millimetre
    assert same / sum(len(scan) for scan in world.sequence) > 0.99


def test_scans_without_points_and_without_a_clock_are_labelled():
    world = lane(5)
    empty = Scan(np.zeros((0, 3), np.float32))
    labels = labels_of([empty, *(Scan(scan.points) for scan in world.sequence), empty])
    assert [len(label) for label in labels] == [0, *(len(scan) for scan in world.sequence), 0]


def test_what_each_stage_takes_is_measured():
    segmenter = OnlineSegmenter(changes_move(), settings(), timing=SweepTiming())
    for scan in lane(4).sequence:
        segmenter.step(scan)
    assert {stage: len(segmenter.seconds[stage]) for stage in STAGES} == dict.fromkeys(STAGES, 4)


@pytest.mark.slow
def test_the_sensors_way_is_found_from_the_scans_alone(city, scans):
    true = city.reference_poses
    segmenter = OnlineSegmenter(changes_move(), settings())
    for scan in scans:
        segmenter.step(scan)
    way = np.linalg.norm(true[-1, :3, 3])
    assert way > 5.0
    assert np.linalg.norm(segmenter.T_world_sensor[:3, 3] - true[-1, :3, 3]) < 0.1 * way
