"""The result of `label` and of `load`: one type over the same files; what it says by hand-computed cases."""

import numpy as np
import pytest
from made_run import CENTERS, INSTANCES, LABELS, T_WORLD_SENSOR, make_run, make_scans
from worlds import lane

import automos
from automos.core.array_sequence import ArraySequence
from automos.core.workspace import RUN_FILE
from automos.result import Result, load
from automos.review.session import Session


@pytest.fixture
def result(tmp_path):
    run = make_run(tmp_path / "run")
    return Result(run.folder, run.sequence)


@pytest.fixture(scope="module")
def labelled(tmp_path_factory):
    """Return a lane's result in a folder of its own, and one in a temporary folder."""
    world, folder = lane(12), tmp_path_factory.mktemp("kept") / "run"
    kept = automos.label(world.sequence, poses=world.poses, workspace=automos.Workspace(folder), workers=1)
    return kept, automos.label(world.sequence, poses=world.poses, workers=1)


def files_of(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_objects_are_those_of_the_run(result):
    standing, moving = result.objects
    assert (standing.id, standing.verdict, moving.id, moving.verdict) == (1, "static", 2, "moving")
    assert (standing.p_moved, moving.p_moved) == (0.0, 0.875)  # one less the confidence of standing, which is 1
    assert moving.scans.tolist() == [0, 1, 2]
    assert moving.observed.tolist() == [True, False, True]
    np.testing.assert_allclose(moving.boxes.center, [CENTERS[2, i] for i in range(3)])
    np.testing.assert_allclose(np.diff(moving.stamps), 0.1, atol=1e-6)
    assert sum(moving.kinds.values()) == pytest.approx(1.0, abs=0.01)
    assert moving.kind == "car"  # 4 by 2 by 1.5 metres
    assert not moving.moves.any()  # no scan says that it moves in it


def test_points_have_labels_objects_and_flow(result):
    for i, (labels, objects) in enumerate(zip(LABELS, INSTANCES, strict=True)):
        points = result.points(i)
        assert (len(points), points.labels.tolist(), points.object.tolist()) == (len(labels), labels, objects)
    scan, flow = make_scans()[0], result.points(0).flow
    T_next_this = np.linalg.inv(T_WORLD_SENSOR[1]) @ T_WORLD_SENSOR[0]
    still = scan.points @ T_next_this[:3, :3].T + T_next_this[:3, 3] - scan.points
    np.testing.assert_allclose(flow[0], still[0], atol=1e-4)  # static: the motion of the sensor alone
    assert np.isnan(flow[[3, 5]]).all()  # without a label; moving, but of no object
    own = np.linalg.norm(flow[1:3] - still[1:3], axis=1)
    np.testing.assert_allclose(own, 0.5, atol=1e-3)  # 5 m/s for a tenth of a second
    assert np.isnan(result.points(2).flow).all()  # nothing comes after the last
    with pytest.raises(IndexError):
        result.points(3)


def test_the_trajectory_has_times_and_poses(result):
    np.testing.assert_allclose(result.trajectory.T_world_sensor, T_WORLD_SENSOR)
    np.testing.assert_allclose(np.diff(result.trajectory.stamps), 0.1, atol=1e-6)


def test_a_table_has_a_row_for_every_box(result):
    pytest.importorskip("pandas")
    table = result.to_dataframe()
    assert table["object"].tolist() == [1, 2, 2, 2]
    assert table["scan"].tolist() == [0, 0, 1, 2]
    assert table.loc[1:, ["x", "y", "z"]].to_numpy().tolist() == [CENTERS[2, i] for i in range(3)]
    assert set(table.loc[1:, "verdict"]) == {"moving"}
    assert table["vx"].tolist() == [5.0] * 4


def test_label_writes_the_same_files_wherever_its_results_are_and_save_copies_them(labelled, tmp_path):
    kept, temporary = labelled
    temporary.save(tmp_path / "saved")
    files, other = files_of(kept.folder), files_of(tmp_path / "saved")
    assert files.keys() == other.keys()
    differ = {path.name for path in files if files[path] != other[path]}
    assert differ <= {RUN_FILE}  # which has the seconds that it took
    before = files_of(tmp_path / "saved")
    temporary.save(tmp_path / "saved")  # once more, nothing to do
    assert files_of(tmp_path / "saved") == before


def test_what_is_loaded_says_what_was_labelled_and_without_the_recording_all_but_what_needs_its_points(labelled):
    kept, _ = labelled
    alone, whole = load(kept.folder), load(kept.folder, kept.sequence)
    for found in (alone, whole):
        assert repr(found) == repr(kept)
        for name in ("labels", "confidence", "object"):
            np.testing.assert_array_equal(getattr(found.points(3), name), getattr(kept.points(3), name))
        np.testing.assert_array_equal(found.trajectory.T_world_sensor, kept.trajectory.T_world_sensor)
    np.testing.assert_array_equal(whole.points(3).flow, kept.points(3).flow)
    with pytest.raises(automos.InputError, match="does not say which recording it was made from"):
        _ = alone.points(3).flow
    assert "<img" in whole._repr_html_()
    assert alone._repr_html_() == f"<div>{repr(alone).replace('<', '&lt;').replace('>', '&gt;')}</div>"


def test_save_leaves_what_is_a_strangers_or_of_another_run(labelled, result, tmp_path):
    kept, _ = labelled
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "thesis.tex").write_text("mine")
    with pytest.raises(automos.InputError, match=r"holds thesis[.]tex, and automos did not make that folder"):
        kept.save(tmp_path / "theirs")
    with pytest.raises(automos.InputError, match="holds results of another run"):
        kept.save(result.folder)
    assert files_of(tmp_path / "theirs").keys() == {
        (tmp_path / "theirs" / "thesis.tex").relative_to(tmp_path / "theirs")
    }


def test_a_temporary_folder_goes_with_its_result():
    world = lane(8)
    result = automos.label(world.sequence, poses=world.poses, workers=1)
    folder = result.folder
    assert (folder / RUN_FILE).exists()
    del result
    assert not folder.exists()


def test_what_a_person_decided_is_in_all_that_a_result_says(labelled, tmp_path):
    labelled[1].save(tmp_path / "run")
    result = load(tmp_path / "run", labelled[0].sequence)
    mover = next(found for found in result.objects if found.verdict == "moving")
    scan = int(mover.scans[len(mover) // 2])
    assert (result.points(scan).object == mover.id).any()
    session = Session(result)
    session.decide([mover.id], "static")
    session.close()
    after = load(tmp_path / "run", labelled[0].sequence)
    assert next(found for found in after.objects if found.id == mover.id).verdict == "static"
    was_its = result.points(scan).object == mover.id
    assert not (after.points(scan).object == mover.id).any()
    assert len(after.points(scan).confidence) == len(was_its)


def test_a_recording_of_other_scans_is_refused(labelled):
    scans = [np.zeros((5, 3), np.float32)] * 20
    with pytest.raises(automos.InputError, match="was made from another recording"):
        load(labelled[0].folder, scans)
    with pytest.raises(automos.InputError, match="labels, but its scan has 5 points"):
        _ = load(labelled[0].folder, ArraySequence(scans[:12])).points(0).flow
