"""End-point errors counted by hand, and the motion of points in boxes that turn."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from automos.cli import app
from automos.core.upright_boxes import Boxes
from automos.evaluation.flow import count_flow, evaluate_flow
from automos.readers import open_sequence
from automos.readers.box_truth import motion_with_boxes
from automos.simulation import simulate, write

NOW = np.array([[1.0, 0, 0], [0.02, 0, 0], [0, 0, 0], [0, 0, 0], [np.nan, 0, 0]])
"""Truth of five points in a tenth of a second: 10 m/s, 0.2 m/s and standing on objects, background, unknown."""
IS_OBJECT = np.array([True, True, True, False, True])


def test_each_kind_of_point_has_its_own_mean_and_three_way_is_their_mean():
    found = NOW + np.array([[0.3, 0.4, 0], [0, 0.1, 0], [0, 0.3, 0], [0, 0, 0.6], [9, 9, 9]])
    epe = count_flow(found, NOW, IS_OBJECT, 0.1).epe
    # 0.5 m off what drives; 0.1 and 0.3 off what crawls or stands; 0.6 off the wall; the unknown point says nothing
    assert epe == pytest.approx({"moving": 0.5, "standing": 0.2, "background": 0.6, "three_way": 1.3 / 3})


def test_nothing_moves_scores_one_and_exact_scores_zero_whatever_the_speeds():
    truth = np.array([[0.08, 0, 0], [0.08, 0, 0], [0, 2.5, 0]])  # a walker of two points and a car of one
    is_object = np.ones(3, bool)
    assert count_flow(np.zeros((3, 3)), truth, is_object, 0.1).normalised == pytest.approx(1.0)
    assert count_flow(truth, truth, is_object, 0.1).normalised == 0.0
    # Half the walker's speed is missing and none of the car's: the mean over the two buckets, not over the points
    assert count_flow(truth * [[0.5], [0.5], [1]], truth, is_object, 0.1).normalised == pytest.approx(0.25)


def test_scans_add_up_to_what_all_points_together_give():
    rng = np.random.default_rng(0)
    truth, found, is_object = rng.normal(size=(90, 3)), rng.normal(size=(90, 3)), rng.random(90) < 0.5
    truth[::3] = 0.0  # some of them on objects that stand, some on none
    whole = count_flow(found, truth, is_object, 0.1)
    parts = sum((count_flow(found[s], truth[s], is_object[s], 0.1) for s in (slice(0, 20), slice(20, 90))), start=whole)
    assert parts.epe == pytest.approx(whole.epe)
    assert parts.normalised == pytest.approx(whole.normalised)


def test_points_move_with_their_box_and_turn_with_it():
    boxes = Boxes(np.array([[10.0, 0, 1]]), np.array([[4.0, 2, 2]]), np.array([0.0]), np.ones(1))
    later = Boxes(np.array([[11.0, 0, 1]]), boxes.size, np.array([np.pi / 2]), np.ones(1))
    points = np.array([[12.0, 0, 1], [10, 0, 1], [0, 0, 0], [10, 0.5, 1]])
    instance = np.array([7, 7, 0, 8])
    motion = motion_with_boxes(points, instance, (np.array([7]), boxes), (np.array([7]), later))
    # The front swings from (12, 0) to (11, 2); the middle goes a metre on; 8 has no box
    assert motion[:3] == pytest.approx(np.array([[-1.0, 2, 0], [1, 0, 0], [0, 0, 0]]), abs=1e-6)
    assert np.isnan(motion[3]).all()


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """Return a simulated recording on disk."""
    out = tmp_path_factory.mktemp("simulated") / "street"
    write(simulate("city", "VLP-16", 12, 5), out, 1)
    return out


def test_the_truth_of_a_simulated_recording_scores_itself_perfectly(simulated):
    sequence = open_sequence(simulated)
    counts = evaluate_flow(sequence, lambda i: np.nan_to_num(sequence.truth_motion(i)))
    assert counts.threeway[0, 0] > 0
    assert counts.epe["three_way"] == 0.0
    moves = np.linalg.norm(np.nan_to_num(sequence.truth_motion(3)), axis=1) > 0.05
    assert (sequence.truth(3)[moves] & 0xFFFF == 251).mean() > 0.99


def test_evaluate_prints_the_flow_of_a_run_and_writes_it(simulated, tmp_path):
    run = CliRunner().invoke
    assert run(app, ["label", str(simulated), "--out", str(tmp_path / "run"), "--workers", "1"]).exit_code == 0
    done = run(app, ["evaluate", str(tmp_path / "run"), str(simulated), "--json", str(tmp_path / "scores.json")])
    assert done.exit_code == 0, done.output
    assert "Scene flow" in done.output
    flow = json.loads((tmp_path / "scores.json").read_text())["flow"]
    assert flow["epe_background"] == pytest.approx(0.0, abs=0.005)
    assert 0.0 <= flow["normalised"] < 1.0
