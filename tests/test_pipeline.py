"""The whole method on a tiny world: what must not change a label, what must change one, what is made again."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from worlds import World, iou_of_moving, lane, street

from automos.core.array_sequence import ArraySequence
from automos.core.errors import InputError
from automos.core.geometry import make_transform
from automos.core.labels import Label
from automos.core.scan import Scan
from automos.core.workspace import Workspace
from automos.objects.verdict import Verdict
from automos.pipeline import Found, Steps, stage_keys
from automos.settings import LabelsSettings, Settings, load_settings

PAPER, DEFAULT = load_settings("paper"), load_settings("default")


@dataclass
class Case:
    """A world, settings, and the labels they give."""

    world: World
    settings: Settings
    result: Found

    def label(self, sequence: ArraySequence | None = None, poses: np.ndarray | None = None, workers: int = 1) -> Found:
        """Return the labels of other scans, or with other poses."""
        sequence = self.world.sequence if sequence is None else sequence
        return Steps(
            sequence, self.settings, poses=self.world.poses if poses is None else poses, workers=workers
        ).found()


@pytest.fixture(scope="module", params=["default", "paper"])
def case(request) -> Case:
    """Return a street under the default preset, and a lane under the paper's, which is slower and sees less."""
    world, settings = (street(), DEFAULT) if request.param == "default" else (lane(), PAPER)
    return Case(world, settings, Steps(world.sequence, settings, poses=world.poses, workers=1).found())


def labels_of(result: Found) -> list[np.ndarray]:
    return [result.labels(i) for i in range(len(result))]


def with_points(sequence: ArraySequence, clouds) -> ArraySequence:
    """Return the sequence with other points."""
    scans = [Scan(cloud, stamp=scan.stamp, name=scan.name) for scan, cloud in zip(sequence, clouds, strict=True)]
    return ArraySequence(scans, is_compensated=True)


# ------------------------------------------------------------------------------------------------- what is found
def test_most_of_what_moves_is_found_and_little_else(case):
    # floors, not scores: the paper's method loses parts of objects that it sees for a second only
    assert iou_of_moving(labels_of(case.result), case.world.truth) > (0.5 if case.settings is PAPER else 0.85)
    said = np.concatenate(labels_of(case.result)) == Label.MOVING
    assert (np.concatenate(case.world.truth)[said] == Label.MOVING).mean() > 0.9


def test_every_point_has_a_label_and_every_moving_point_a_moving_track(case):
    for i, scan in enumerate(case.world.sequence):
        labels, tracks = case.result.labels(i), case.result.track_ids(i)
        assert labels.shape == tracks.shape == (len(scan),)
        assert set(np.unique(labels)) <= {Label.STATIC, Label.MOVING}
        assert ((tracks >= 0) <= (labels == Label.MOVING)).all()
        assert np.count_nonzero(labels[tracks < 0] == Label.MOVING) <= 0.01 * len(scan)  # scraps of no body
        assert (case.result.verdicts.verdict[np.unique(tracks[tracks >= 0])] == Verdict.MOVING).all()


def test_labels_below_the_confidence_asked_for_are_left_out_and_the_others_as_they_were(case):
    sure = np.concatenate([case.result.confidence(i) for i in range(len(case.result))])
    plain = np.concatenate(labels_of(case.result))
    values, count = np.unique(sure, return_counts=True)
    k = int(np.searchsorted(np.cumsum(count) / len(sure), 0.02))  # between two values that there are
    limit = float(values[k : k + 2].mean())
    asked = case.settings.model_copy(update={"labels": LabelsSettings(unsure=limit)})
    found = Steps(case.world.sequence, asked, poses=case.world.poses, workers=1).found()
    expected = np.where(sure >= limit, plain, Label.UNLABELED)
    assert 0 < (expected == Label.UNLABELED).mean() < 0.9
    np.testing.assert_array_equal(np.concatenate(labels_of(found)), expected)


def test_moving_now_leaves_out_objects_that_stand_at_the_time(case):
    asked = case.settings.model_copy(update={"labels": LabelsSettings(moving="now")})
    found = Steps(case.world.sequence, asked, poses=case.world.poses, workers=1).found()
    tracks = found.tracks
    for i in range(len(found)):
        in_scan = np.flatnonzero(tracks.scan == i)
        fast = tracks.track[in_scan][tracks.p_moving[in_scan] >= 0.5]
        assert set(found.track_ids(i)) - {-1} <= set(fast)
        now, ever = found.labels(i) == Label.MOVING, case.result.labels(i) == Label.MOVING
        assert (now <= ever).all()
    assert sum((found.labels(i) == Label.MOVING).sum() for i in range(len(found))) > 0


@pytest.mark.parametrize("settings", [DEFAULT, PAPER], ids=["default", "paper"])
def test_where_nothing_moves_no_point_is_moving(settings):
    world = street(traffic=())
    result = Steps(world.sequence, settings, poses=world.poses, workers=1).found()
    for labels in labels_of(result):
        assert (labels == Label.STATIC).all()
    assert not (result.verdicts.verdict == Verdict.MOVING).any()


def test_without_poses_they_come_from_the_scans():
    # by the default preset: KISS-ICP alone takes the rings on the ground, which move along, for a world at rest
    world = street()
    result = Steps(world.sequence, DEFAULT, workers=1).found()
    np.testing.assert_allclose(result.trajectory.T_world_sensor[:, :3, 3], world.poses[:, :3, 3], atol=0.25)
    assert iou_of_moving(labels_of(result), world.truth) > 0.75


@pytest.mark.parametrize("euler", [(0, 10, 0), (180, 0, 0), (8, -12, 77)], ids=["pitched", "upside down", "askew"])
def test_the_sensor_may_be_mounted_askew(case, euler):
    world, R = case.world, Rotation.from_euler("xyz", euler, degrees=True).as_matrix()
    turned = with_points(
        world.sequence, [(scan.points.astype(float) @ R).astype(np.float32) for scan in world.sequence]
    )
    result = case.label(turned, world.poses @ make_transform(R))
    # its bins, beams and voxels lie otherwise, so not every label is the same
    assert iou_of_moving(labels_of(result), world.truth) > (0.35 if case.settings is PAPER else 0.85)


# -------------------------------------------------------------------------------------- what must not change labels
@pytest.mark.parametrize(
    ("euler", "shift"),
    [((0, 0, 90), (0, 0, 0)), ((0, 0, -133), (800, -1500, 40)), ((20, -35, 60), (800, -1500, 40))],
    ids=["quarter", "turned and away", "tilted and away"],
)
def test_turning_and_shifting_the_world_changes_no_label(case, euler, shift):
    T = make_transform(Rotation.from_euler("xyz", euler, degrees=True).as_matrix(), shift)
    result = case.label(poses=T @ case.world.poses)
    for got, want in zip(labels_of(result), labels_of(case.result), strict=True):
        np.testing.assert_array_equal(got, want)


def test_poses_in_a_national_grid_change_hardly_a_label(case):
    # at 5000 km a double holds nanometres: a point in a hundred thousand may cross a voxel's border
    result = case.label(poses=make_transform(t=[4.5e6, 5.4e6, 300.0]) @ case.world.poses)
    changed = np.concatenate(labels_of(result)) != np.concatenate(labels_of(case.result))
    assert changed.mean() < 1e-4


def test_shuffling_a_scans_points_permutes_its_labels(case):
    rng = np.random.default_rng(0)
    order = [rng.permutation(len(scan)) for scan in case.world.sequence]
    clouds = [scan.points[o] for scan, o in zip(case.world.sequence, order, strict=True)]
    result = case.label(with_points(case.world.sequence, clouds))
    np.testing.assert_array_equal(result.trajectory.T_level_world, case.result.trajectory.T_level_world)
    for i, o in enumerate(order):
        np.testing.assert_array_equal(result.labels(i), case.result.labels(i)[o])


def test_points_that_are_no_measurement_get_label_0_and_change_no_other(case):
    rng = np.random.default_rng(0)
    junk = np.array(
        [[np.nan] * 3, [1, np.nan, 1], [np.inf, 0, 0], [0, 0, 0], [1e-3, 0, 0], [1, -np.inf, 1]], np.float32
    )
    clouds, is_junk = [], []
    for scan in case.world.sequence:
        bad = rng.permutation(np.arange(len(scan) + 60) < 60)
        cloud = np.empty((len(bad), 3), np.float32)
        cloud[bad], cloud[~bad] = np.tile(junk, (10, 1)), scan.points
        clouds.append(cloud)
        is_junk.append(bad)
    result = case.label(with_points(case.world.sequence, clouds))
    for i, bad in enumerate(is_junk):
        assert (result.labels(i)[bad] == Label.UNLABELED).all()
        assert (result.track_ids(i)[bad] == -1).all()
        np.testing.assert_array_equal(result.labels(i)[~bad], case.result.labels(i))


@pytest.mark.parametrize("workers", [1, 2])
def test_reruns_are_identical_whatever_the_number_of_workers(case, workers):
    result = case.label(workers=workers)
    for i in range(len(result)):
        np.testing.assert_array_equal(result.labels(i), case.result.labels(i))
        np.testing.assert_array_equal(result.track_ids(i), case.result.track_ids(i))
    for name, column in case.result.tracks.to_arrays().items():
        np.testing.assert_array_equal(getattr(result.tracks, name), column)


# -------------------------------------------------------------------------------------------------- odd recordings
def test_an_empty_scan_in_the_middle_has_no_labels_and_the_others_all_of_theirs(case):
    clouds = [scan.points for scan in case.world.sequence]
    clouds[5] = np.zeros((0, 3), np.float32)
    result = case.label(with_points(case.world.sequence, clouds))
    assert [len(labels) for labels in labels_of(result)] == [len(cloud) for cloud in clouds]
    assert sum((labels == Label.MOVING).sum() for labels in labels_of(result)) > 0


@pytest.mark.parametrize("settings", [DEFAULT, PAPER], ids=["default", "paper"])
@pytest.mark.parametrize("with_poses", [True, False], ids=["poses given", "poses estimated"])
@pytest.mark.parametrize("n_scans", [1, 2])
def test_one_scan_and_two_scans_are_recordings(n_scans, with_poses, settings):
    world = lane(n_scans)
    result = Steps(world.sequence, settings, poses=world.poses if with_poses else None, workers=1).found()
    assert len(result) == n_scans
    for labels, scan in zip(labels_of(result), world.sequence, strict=True):
        np.testing.assert_array_equal(labels, np.full(len(scan), Label.STATIC))


@pytest.mark.parametrize("settings", [DEFAULT, PAPER], ids=["default", "paper"])
@pytest.mark.parametrize("n_points", [0, 3])
def test_scans_of_hardly_a_point_are_labelled_all_the_same(n_points, settings):
    clouds = [np.full((n_points, 3), 5.0 + i, np.float32) for i in range(4)]
    result = Steps(ArraySequence(clouds, 0.1 * np.arange(4)), settings, workers=1).found()
    for labels in labels_of(result):
        np.testing.assert_array_equal(labels, np.full(n_points, Label.STATIC))


def bent(poses: np.ndarray, fault: str) -> np.ndarray:
    poses = poses.copy()
    match fault:
        case "too few":
            return poses[:-1]
        case "3 x 4":
            return poses[:, :3]
        case "scaled":
            poses[3, :3, :3] *= 1.1
        case "mirrored":
            poses[3, :3, 2] *= -1.0
        case "not a number":
            poses[3, 0, 3] = np.nan
    return poses


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("too few", r"poses must be \(8, 4, 4\).*got shape \(7, 4, 4\)"),
        ("3 x 4", r"poses must be \(8, 4, 4\)"),
        ("scaled", "pose 3 is (no|not a) rigid transform"),
        ("mirrored", "pose 3 is (no|not a) rigid transform"),
        ("not a number", "pose 3 is (no|not a) rigid transform"),
    ],
)
def test_poses_that_are_none_are_told_with_their_place(fault, message):
    world = lane(8)
    with pytest.raises(InputError, match=message) as error:
        Steps(world.sequence, PAPER, poses=bent(world.poses, fault), workers=1).found()
    assert "\n" not in str(error.value)


def test_a_recording_without_scans_is_told():
    with pytest.raises(InputError, match="holds no scans"):
        Steps(ArraySequence([]), PAPER).found()


# ------------------------------------------------------------------------------------------------ stages and resume
STAGES = ["odometry", "candidates", "instances", "tracking", "labels"]


@pytest.mark.parametrize(
    ("key", "value", "first_changed"),
    [
        ("odometry.max_range", 60.0, "odometry"),
        ("candidates.free_space.hit", 0.3, "candidates"),
        ("instances.hdbscan.min_points", 9, "instances"),
        ("tracking.max_misses", 2, "tracking"),
        ("labels.moving", "now", "labels"),
        ("output.track_ids", True, None),
    ],
)
def test_a_changed_setting_changes_the_fingerprints_from_its_stage_on(key, value, first_changed):
    world = lane(8)
    before = stage_keys(world.sequence, PAPER, world.poses)
    after = stage_keys(world.sequence, load_settings("paper", overrides={key: value}), world.poses)
    changed = [stage for stage in STAGES if before[stage] != after[stage]]
    assert changed == ([] if first_changed is None else STAGES[STAGES.index(first_changed) :])


def test_other_scans_and_other_poses_change_every_fingerprint():
    world = lane(8)
    before = stage_keys(world.sequence, PAPER, world.poses)
    others = [
        stage_keys(world.sequence, PAPER, None),
        stage_keys(world.sequence, PAPER, world.poses + 1e-9),
        stage_keys(lane(7).sequence, PAPER, world.poses[:7]),
    ]
    for other in others:
        assert all(before[stage] != other[stage] for stage in STAGES)


def test_a_second_run_makes_nothing_again(tmp_path):
    world, workspace = lane(8), Workspace(tmp_path)
    first = Steps(world.sequence, PAPER, poses=world.poses, workspace=workspace, workers=1).found()
    second = Steps(world.sequence, PAPER, poses=world.poses, workspace=workspace, workers=1).found()
    assert all(first.seconds[stage] > 0.0 for stage in STAGES)
    assert all(second.seconds[stage] == 0.0 for stage in STAGES)
    for got, want in zip(labels_of(second), labels_of(first), strict=True):
        np.testing.assert_array_equal(got, want)


def test_a_changed_setting_makes_only_what_depends_on_it_and_reads_nothing_old(tmp_path):
    world, workspace = lane(), Workspace(tmp_path)
    strict = load_settings("paper", overrides={"tracking.verdict.min_observations": 99})
    before = Steps(world.sequence, PAPER, poses=world.poses, workspace=workspace, workers=1).found()
    assert any((labels == Label.MOVING).any() for labels in labels_of(before))
    result = Steps(world.sequence, strict, poses=world.poses, workspace=workspace, workers=1).found()
    assert [stage for stage in STAGES if result.seconds[stage] > 0.0] == ["tracking", "labels"]
    assert all((labels == Label.STATIC).all() for labels in labels_of(result))
    assert len(list((tmp_path / "stages").iterdir())) == len(STAGES)


class Watched(Workspace):
    """A workspace that notes what is saved, and breaks before the fourth scan of one stage is."""

    def __init__(self, root, breaks_in: str = ""):
        super().__init__(root)
        self.breaks_in = breaks_in
        self.saved: list[tuple[str, str]] = []

    def stage(self, name, key):
        stage = super().stage(name, key)
        save = stage.save

        def watched(scan, arrays):
            if name == self.breaks_in and len([s for s, _ in self.saved if s == name]) == 3:
                raise KeyboardInterrupt
            save(scan, arrays)
            self.saved.append((name, scan))

        stage.save = watched
        return stage


@pytest.mark.parametrize("stage", ["candidates", "instances", "labels"])
def test_an_interrupted_stage_goes_on_with_the_scans_it_has_not_saved(case, tmp_path, stage):
    first, second = Watched(tmp_path, stage), Watched(tmp_path)
    sequence, poses, names = case.world.sequence, case.world.poses, case.world.sequence.names
    with pytest.raises(KeyboardInterrupt):
        Steps(sequence, case.settings, poses=poses, workspace=first, workers=1).found()
    result = Steps(sequence, case.settings, poses=poses, workspace=second, workers=1).found()
    assert not set(first.saved) & set(second.saved)
    assert [scan for name, scan in first.saved if name == stage] == names[:3]
    assert [scan for name, scan in second.saved if name == stage] == names[3:]
    for got, want in zip(labels_of(result), labels_of(case.result), strict=True):
        np.testing.assert_array_equal(got, want)


def test_progress_counts_every_scan_of_every_stage():
    world, ticks = lane(8), []
    Steps(world.sequence, PAPER, poses=world.poses, workers=1, progress=lambda *tick: ticks.append(tick)).found()
    for stage in ("candidates", "instances", "labels"):
        assert [tick for tick in ticks if tick[0] == stage] == [(stage, i + 1, 8) for i in range(8)]
