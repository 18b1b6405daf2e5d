"""Methods side by side on a tiny world: scored, kept, drawn, and going on without what is missing."""

import io
import json
import subprocess
import sys
import time

import numpy as np
import pytest
from recorded import write_recording
from rich.console import Console
from typer.testing import CliRunner
from worlds import lane

from automos import open_sequence
from automos.baselines import yoon
from automos.baselines.comparison import runs as runs_module
from automos.baselines.comparison.agreement import Agreement, measure_agreement
from automos.baselines.comparison.compare import Comparison, compare, write_comparison
from automos.baselines.comparison.cost import Cost, Effort
from automos.baselines.comparison.runs import MethodRuns
from automos.baselines.methods import TITLES, choose_methods
from automos.cli import app
from automos.core.atomic import held
from automos.core.errors import InputError
from automos.evaluation.moving import Counts, Scores, count

METHODS = ["yoon", "m_detector"]


@pytest.fixture(scope="module")
def world():
    return lane(8)


@pytest.fixture(scope="module")
def recording(world, tmp_path_factory):
    return write_recording(world, tmp_path_factory.mktemp("recording") / "lane")


@pytest.fixture
def in_this_process(monkeypatch):
    """Run methods without a process of their own: tests may then change what they see."""
    monkeypatch.setattr(runs_module, "_in_own_process", lambda *task: runs_module._run(*task))


def make_runs(recording, folder, world, **overrides) -> MethodRuns:
    return MethodRuns(open_sequence(recording), folder, overrides, poses=world.poses, workers=1)


@pytest.mark.slow
def test_scores_are_those_of_the_labels_that_were_kept(recording, world, tmp_path, in_this_process):
    runs = make_runs(recording, tmp_path, world)
    comparison = compare(runs, METHODS)
    assert list(comparison.scores) == ["yoon", "m_detector"]
    for method, scores in comparison.scores.items():
        counts = Counts()
        for i, truth in enumerate(world.truth):
            labels = np.fromfile(tmp_path / method / "predictions" / f"{runs.sequence.names[i]}.label", np.uint32)
            assert set(labels) <= {0, 9, 251}
            counts += count(labels, truth)
        assert scores == counts.scores
        assert comparison.costs[method].seconds_per_scan > 0.0
    assert comparison.scores["yoon"].recall > 0.5
    report, picture = write_comparison(runs, comparison)
    found = json.loads(report.read_text())
    assert found["methods"]["yoon"]["iou"] == comparison.scores["yoon"].iou
    assert found["methods"]["yoon"]["false_dynamic"] == comparison.scores["yoon"].false_dynamic
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_what_was_run_is_not_run_again_unless_its_settings_change(
    recording, world, tmp_path, in_this_process, monkeypatch
):
    first, asked = make_runs(recording, tmp_path, world).cost("yoon"), []
    monkeypatch.setattr(runs_module, "_run", lambda *task: asked.append(task[0]) or first)
    assert make_runs(recording, tmp_path, world).cost("yoon") == first
    assert asked == []
    make_runs(recording, tmp_path, world, **{"tracking.max_misses": 3}).cost("yoon")  # not a setting of its
    assert asked == []
    make_runs(recording, tmp_path, world, **{"candidates.ground.tolerance": 0.1}).cost("yoon")
    assert asked == ["yoon"]
    monkeypatch.setattr(runs_module, "published", lambda name: yoon.Parameters(margin=0.7))
    make_runs(recording, tmp_path, world).cost("yoon")
    assert asked == ["yoon", "yoon"]


def test_a_missing_library_is_named_and_the_others_go_on(recording, world, tmp_path, in_this_process, monkeypatch):
    monkeypatch.setitem(sys.modules, "dufomap", None)
    comparison = compare(make_runs(recording, tmp_path, world), ["dufomap", "yoon"])
    assert list(comparison.costs) == ["yoon"]
    assert "[dufomap]'" in comparison.missing["dufomap"]
    assert "[dufomap]" in str(comparison.tables()[0].caption)
    with pytest.raises(InputError, match=r"no method could be run.*\[dufomap\]"):
        compare(make_runs(recording, tmp_path, world), ["dufomap"])


def test_without_truth_pictures_and_agreement_remain(world, tmp_path, in_this_process):
    recording = write_recording(world, tmp_path / "unknown", with_truth=False)
    runs = make_runs(recording, tmp_path / "out", world)
    comparison = compare(runs, METHODS)
    assert comparison.scores == {}
    assert comparison.agreement.iou.shape == (2, 2)
    report, picture = write_comparison(runs, comparison)
    found = json.loads(report.read_text())
    assert "iou" not in found["methods"]["yoon"]
    assert set(found["agreement"]) == set(METHODS)
    assert picture.exists()


@pytest.mark.slow
def test_the_pipeline_is_given_the_same_poses(recording, world, tmp_path, in_this_process, monkeypatch):
    def no_odometry(*_):
        raise AssertionError("poses were estimated again")

    runs = make_runs(recording, tmp_path, world)
    monkeypatch.setattr("automos.pipeline.estimate_trajectory", no_odometry)
    assert runs.cost("default").seconds_per_scan > 0.0
    assert not (tmp_path / "default" / "scratch").exists()


def test_tables_of_all_methods_have_whole_words_in_80_columns():
    everyone = list(TITLES)
    iou = np.full((len(everyone), len(everyone)), 0.99)
    costs = {name: Cost([123.4, 123.5], [200.0] * 2, [12e9] * 2, [0.0] * 2) for name in everyone}
    scores = {name: Scores(1, 0, 0, 1, 0) for name in everyone}
    missing = {"dufomap": "pip install '.[dufomap]'"}
    agreement = Agreement(tuple(everyone), iou)
    comparison = Comparison("log", 9999, "own poses", scores, costs, missing, agreement)
    console = Console(width=80, record=True, file=io.StringIO())
    for table in comparison.tables():
        console.print(table)
    text = console.export_text()
    assert "…" not in text
    for name in everyone:  # in the one table and in the other, in one piece
        assert sum(TITLES[name] in line for line in text.splitlines()) >= 2
    assert "precision" in text
    assert "DUFOMap: pip install '.[dufomap]'" in text


def test_an_unknown_method_lists_the_known_ones():
    assert choose_methods(None) == list(TITLES)
    assert choose_methods(["default", "yoon", "yoon"]) == ["yoon", "default"]
    with pytest.raises(InputError, match=r"'removed'.*mean 'removert'.*octomap.*default"):
        choose_methods(["removed"])


def test_a_scan_that_is_not_there_cannot_be_drawn(recording, world, tmp_path, in_this_process):
    runs = make_runs(recording, tmp_path, world)
    with pytest.raises(InputError, match="there is no scan 99"):
        write_comparison(runs, compare(runs, ["yoon"]), scan=99)


def test_agreement_is_intersection_over_union_over_all_scans():
    a = [np.array([1, 1, 0, 0], bool), np.array([1], bool)]
    b = [np.array([1, 0, 1, 0], bool), np.array([1], bool)]
    nothing = [np.zeros(4, bool), np.zeros(1, bool)]
    agreement = measure_agreement(["a", "b", "c"], zip(a, b, nothing, strict=True))
    assert agreement.iou[0, 1] == agreement.iou[1, 0] == 2 / 4  # 2 common points of 4
    assert agreement.iou[0, 0] == 1.0
    assert agreement.iou[0, 2] == 0.0
    assert np.isnan(agreement.iou[2, 2])
    assert agreement.to_dict()["c"] == {"a": 0.0, "b": 0.0, "c": None}


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_peak_memory_sees_what_was_held_for_a_while():

    with Effort() as before:
        time.sleep(0.3)
    with Effort() as memory:
        held = np.ones(40_000_000)  # 320 MB
        time.sleep(0.5)
        del held
    assert memory.peak - before.peak > 250e6


def test_the_command_runs_methods_in_processes_of_their_own_and_says_where_results_are(recording, tmp_path):
    words = ["compare", recording, "--method", "yoon", "--out", tmp_path / "out"]
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == 0, done.output
    assert "Yoon's" in done.output
    assert (tmp_path / "out" / "compare.png").exists()
    assert (tmp_path / "out" / "compare.json").exists()


def write_predictions(folder, world, label=lambda truth: truth):
    folder.mkdir(parents=True)
    for i, truth in enumerate(world.truth):
        label(truth).astype(np.uint32).tofile(folder / f"{i:06d}.label")
    return folder


def test_labels_of_any_program_are_compared_like_a_method(recording, world, tmp_path, in_this_process):
    # another network's classes: a moving car is 252, and instances sit in the upper bits
    theirs = write_predictions(
        tmp_path / "theirs" / "predictions", world, lambda truth: np.where(truth == 251, (7 << 16) | 252, 40)
    )
    runs = MethodRuns(
        open_sequence(recording), tmp_path / "out", {}, world.poses, 1, predictions={"Theirs": theirs.parent}
    )
    comparison = compare(runs, ["yoon"])
    assert list(comparison.costs) == ["yoon", "Theirs"]
    assert comparison.scores["Theirs"].iou == 1.0
    found = comparison.to_dict()["methods"]
    assert found["Theirs"]["needs_future"] is None
    assert "seconds_per_scan" not in found["Theirs"]
    assert found["yoon"]["needs_future"] is True
    report, picture = write_comparison(runs, comparison)
    assert "Theirs" in report.read_text()
    assert picture.exists()


def test_labels_that_do_not_fit_are_refused_before_anything_runs(recording, world, tmp_path):
    def runs(**predictions):
        return MethodRuns(open_sequence(recording), tmp_path / "out", {}, world.poses, 1, predictions=predictions)

    short = write_predictions(tmp_path / "short", world)
    np.zeros(3, np.uint32).tofile(short / "000005.label")
    with pytest.raises(InputError, match=r"000005.label holds 3 labels"):
        runs(Short=short)
    (short / "000005.label").unlink()
    with pytest.raises(InputError, match=r"000005.label is missing"):
        runs(Short=short)
    with pytest.raises(InputError, match=r"holds no predictions"):
        runs(Nothing=tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"'yoon' is a method"):
        runs(yoon=short)


def test_each_preset_finds_its_own_poses_unless_one_odometry_is_for_all(recording, tmp_path):
    own = MethodRuns(open_sequence(recording), tmp_path, {})
    assert own.trajectory_of("yoon") is own.trajectory
    assert own.trajectory_of("paper") is own.trajectory  # found once, as its settings of the odometry are the same
    shared = MethodRuns(open_sequence(recording), tmp_path, {}, shared=True)
    assert shared.trajectory_of("paper") is shared.trajectory


def test_seconds_are_the_median_of_the_runs_and_say_whether_the_machine_was_busy(
    recording, world, tmp_path, in_this_process
):
    runs = MethodRuns(open_sequence(recording), tmp_path, {}, world.poses, 1, repeats=3)
    cost = runs.cost("yoon")
    assert len(cost.seconds) == len(cost.busy) == len(cost.memory) == len(cost.others) == 3
    assert cost.seconds_per_scan == sorted(cost.seconds)[1]
    assert cost.spread == max(cost.seconds) - min(cost.seconds)
    assert runs.cost("yoon") == cost  # not run again
    assert Cost([1.0], [1.0], [1.0], [0.0]).was_alone
    assert not Cost([1.0], [1.0], [1.0], [1.5]).was_alone
    assert not Cost([1.0], [1.0], [1.0], [float("nan")]).was_alone  # nobody knows


@pytest.mark.skipif(sys.platform != "linux", reason="processor time is read from /proc")
def test_effort_tells_ones_own_work_from_that_of_others():
    with Effort() as effort:
        end = time.thread_time() + 0.5  # of this thread: what watches works beside it, on another core
        while time.thread_time() < end:
            pass
    assert 0.4 < effort.busy < 3.0  # helpers of other tests may end their work meanwhile
    assert effort.seconds >= 0.5
    assert effort.others >= 0.0


@pytest.mark.skipif(sys.platform != "linux", reason="processor time is read from /proc")
def test_effort_leaves_out_what_a_helper_did_before():
    work = "import time\nwhile time.process_time() < 1.0: pass\nprint('done', flush=True)\ninput()"
    helper = subprocess.Popen([sys.executable, "-c", work], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert helper.stdout.readline() == b"done\n"
    with Effort() as effort:
        time.sleep(0.3)
    helper.communicate(b"\n")
    assert effort.busy < 0.9


def test_folders_of_another_program_are_not_replaced_by_those_of_methods(recording, tmp_path):
    theirs = tmp_path / "out" / "yoon" / "map.pcd"
    theirs.parent.mkdir(parents=True)
    theirs.write_text("their own")
    words = ["compare", recording, "--method", "yoon", "--out", tmp_path / "out"]
    ended = CliRunner().invoke(app, [str(word) for word in words])
    assert "out holds yoon, and automos did not make that folder: choose another --out" in str(ended.exception)
    assert theirs.read_text() == "their own"


@pytest.mark.parametrize("command", ["compare", "map"])
def test_two_processes_do_not_write_into_one_folder(recording, tmp_path, command):
    pytest.importorskip("fcntl", reason="Windows has no locks on folders")
    with held(tmp_path / "out"):
        words = [command, recording, "--method", "yoon", "--out", tmp_path / "out"]
        ended = CliRunner().invoke(app, [str(word) for word in words])
    assert "another process writes into" in str(ended.exception)
    assert list((tmp_path / "out").iterdir()) == []


def test_a_scan_that_is_not_there_is_refused_before_any_method_is_run(recording, tmp_path):
    words = ["compare", recording, "--method", "yoon", "--out", tmp_path / "out", "--scan", "999"]
    ended = CliRunner().invoke(app, [str(word) for word in words])
    assert "there is no scan 999" in str(ended.exception)
    assert not (tmp_path / "out" / "yoon").exists()


def test_a_name_and_a_folder_are_asked_of_predictions(recording, tmp_path):
    words = ["compare", recording, "--out", tmp_path / "out", "--predictions", "somewhere"]
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert "give a name and a folder of .label files" in str(done.exception)
