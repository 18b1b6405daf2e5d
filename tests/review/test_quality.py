"""Precision and recall from a random sample: intervals that hold the truth as often as they say."""

import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import binom

from automos.core.errors import InputError
from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.core.workspace import Workspace
from automos.readers import open_sequence
from automos.results.open_run import open_run
from automos.review import sample as sample_module
from automos.review import scenes
from automos.review.looking import Looking
from automos.review.quality import Estimate, ratio, recall, share, total_of_moments
from automos.review.run_stages import Changes, RunStages
from automos.review.sample import append_answer, draw, estimate, read_answers, read_sample, save_sample, strata
from automos.review.session import Session

HOLDS = 0.95
REVIEWS = 400


def test_the_interval_of_a_share_is_clopper_and_pearsons():
    # Newcombe, Statistics in Medicine 1998, Table I: 81 of 263, and 0 of 20
    found = share(81, 263)
    assert (found.low, found.high) == pytest.approx((0.2527, 0.3676), abs=1e-4)
    assert (share(0, 20).low, share(0, 20).high) == pytest.approx((0.0, 0.1684), abs=1e-4)
    assert share(20, 20).high == 1.0


def test_a_recording_of_which_every_scan_was_looked_at_leaves_nothing_open():
    every = total_of_moments(np.array([3.0, 0.0, 5.0]), np.ones(3, np.int64), usual=100.0)
    assert (every.value, every.low, every.high) == (8.0, 8.0, 8.0)


def test_nothing_missed_in_thirty_moments_still_allows_for_what_was_not_seen():
    found = total_of_moments(np.zeros(30), np.full(30, 10), usual=50.0)
    assert (found.value, found.low) == (0.0, 0.0)
    # all 30 look clean with a chance of 2.5 % if something is missed in 11.6 % of the moments
    assert found.high == pytest.approx(0.1157 * 300 * 50 * 0.9, rel=0.01)


def test_a_ratio_of_certain_numbers_is_certain():
    assert ratio(Estimate(3.0, 3.0, 3.0), Estimate(4.0, 4.0, 4.0)) == pytest.approx((0.75, 0.75))


def test_recall_of_what_found_nothing_is_not_known():
    assert recall(Estimate(0.0, 0.0, 10.0), [Estimate(5.0, 1.0, 9.0)]) is None


def spells(n_scans, each, length, size):
    """Return how many points are missed in each scan: things of about `size` points, for about `length` scans each."""

    def missed(rng):
        found = np.zeros(n_scans)
        for _ in range(rng.poisson(each * n_scans)):
            start = rng.integers(n_scans)
            found[start : start + 1 + rng.geometric(1.0 / length)] += rng.lognormal(np.log(size), 0.7)
        return found

    return missed


RECORDINGS = {
    "nothing missed": spells(100, 0.0, 1, 1),
    "one small thing in ten seconds": spells(100, 0.01, 8, 60),
    "one bus in a minute": spells(600, 0.002, 30, 600),
    "a few, often": spells(100, 0.1, 10, 60),
    "many, small": spells(400, 0.5, 20, 20),
    "short and long": spells(40, 0.1, 10, 100),
}


@pytest.mark.parametrize("name", RECORDINGS)
@pytest.mark.parametrize(("right", "left_out"), [(0.97, 0.02), (0.85, 0.005)])
def test_the_intervals_hold_the_truth_95_times_in_100(name, right, left_out):
    rng = np.random.default_rng(7)
    missed = RECORDINGS[name](np.random.default_rng(1))
    n, n_moving, n_fringe = len(missed), 2000 * len(missed), 1500 * len(missed)
    true = n_moving * right
    truth = true / (true + n_fringe * left_out + missed.sum())
    edges = np.linspace(0, n, min(30, n) + 1).round().astype(int)
    holds = np.zeros((REVIEWS, 2))
    for k in range(REVIEWS):
        precision = share(rng.binomial(40, right), 40)
        drawn = np.array([rng.integers(a, b) for a, b in pairwise(edges)])
        moments = total_of_moments(missed[drawn], np.diff(edges), usual=60.0)
        fringe = share(rng.binomial(30, left_out), 30).scaled(n_fringe)
        found = recall(precision.scaled(n_moving), [moments, fringe])
        holds[k] = precision.low <= right <= precision.high, found.low <= truth <= found.high
    assert (holds.mean(axis=0) >= HOLDS).all()


# --------------------------------------------------------------------------------------- on a recording, by its labels
@pytest.fixture(scope="module")
def stages(lane_run):
    return RunStages(lane_run, open_sequence(lane_run.parent / "lane"))


def answered(stages, truth, sample):
    """Return what someone answers who knows the truth of every point."""
    answers = {}
    for n, look in enumerate(sample.looks):
        moves = truth[look.index] == Label.MOVING
        if look.kind == "moment":
            is_moving, is_fringe = sample_module.strata(stages, look.index, Changes())
            answers[n] = "done", int((moves & ~is_moving & ~is_fringe).sum())
        else:
            answers[n] = "moving" if moves[look.row] else "static", 0
    return answers


def test_the_strata_and_the_looks_fit_together(stages):
    sample = draw(stages, Changes(), 100, seed=3)
    kinds = [look.kind for look in sample.looks]
    assert (kinds.count("moving"), kinds.count("fringe"), kinds.count("moment")) == (40, 30, len(stages.names))
    assert sum(look.n_scans for look in sample.looks if look.kind == "moment") == len(stages.names)
    for look in sample.looks:
        if look.kind != "moment":
            masks = dict(zip(("moving", "fringe"), strata(stages, look.index, Changes()), strict=True))
            assert masks[look.kind][look.row]
    counts = [[mask.sum() for mask in strata(stages, i, Changes())] for i in range(len(stages.names))]
    assert (sample.n_moving, sample.n_fringe) == tuple(np.sum(counts, axis=0))


def test_the_intervals_hold_the_truth_of_a_labelled_recording(stages, monkeypatch):
    kept = {index: strata(stages, index, Changes()) for index in range(len(stages.names))}
    monkeypatch.setattr(sample_module, "strata", lambda stages, index, changes: kept[index])
    truth = [to_mos(stages.frames.sequence.truth(i)) for i in range(len(stages.names))]
    found = [stages.labels(i)["label"] for i in range(len(stages.names))]
    true = sum(int(((t == Label.MOVING) & (f == Label.MOVING)).sum()) for t, f in zip(truth, found, strict=True))
    precision = true / sum(int((f == Label.MOVING).sum()) for f in found)
    of_all = true / sum(int((t == Label.MOVING).sum()) for t in truth)
    holds = []
    for seed in range(200):
        sample = draw(stages, Changes(), 60, seed=seed)
        told = estimate(sample, answered(stages, truth, sample))
        holds.append(
            (
                told["precision"]["low"] <= precision <= told["precision"]["high"],
                told["recall"]["low"] - 1e-4 <= of_all <= told["recall"]["high"] + 1e-4,
            )
        )
    # intervals that hold the truth 95 times in 100 do so in fewer of 200 samples once in a thousand times: 179
    assert np.sum(holds, axis=0).min() >= binom.ppf(1e-3, len(holds), HOLDS)


def test_a_sample_is_read_back_and_goes_on_where_it_was_left(stages, tmp_path):
    sample = draw(stages, Changes(), 20, seed=1)
    save_sample(tmp_path, sample)
    assert read_sample(tmp_path) == sample
    append_answer(tmp_path, sample, 0, "moving")
    append_answer(tmp_path, sample, 0, "static")
    append_answer(tmp_path, replace(sample, key="another"), 1, "moving")
    assert read_answers(tmp_path, sample) == {0: ("static", 0)}


def test_the_scan_of_the_point_that_is_asked_about_is_among_those_shown(stages, monkeypatch):
    monkeypatch.setattr(scenes, "MOMENTS", 4)
    looking = Looking(stages, draw(stages, Changes(), 30, seed=2), Changes())
    for number, look in enumerate(looking.sample.looks):
        if look.kind != "moment":
            shown = looking.look(number)
            assert look.index == shown["at"]
            assert look.index in [moment["index"] for moment in shown["moments"]]


def test_what_is_decided_after_a_sample_makes_it_one_of_other_labels(lane_run, tmp_path):
    run = shutil.copytree(lane_run, tmp_path / "run")
    session = Session(open_run(run), n_looks=10)
    session.looking.answer(0, "moving")
    assert "quality" in Workspace(run).read_run()
    assert Session(open_run(run), n_looks=10).looking.sample == session.looking.sample  # it goes on
    session.decide([1], "unknown")
    session.finish()
    assert "quality" not in Workspace(run).read_run()
    assert Session(open_run(run), n_looks=10).looking.sample != session.looking.sample


def test_answers_that_come_at_once_are_all_in_the_record(lane_run, tmp_path):
    run = shutil.copytree(lane_run, tmp_path / "run")
    looking = Session(open_run(run), n_looks=60).looking
    points = [n for n, look in enumerate(looking.sample.looks) if look.kind == "moving"]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda n: looking.answer(n, "moving"), points))
    assert Workspace(run).read_run()["quality"]["answered"]["moving"] == len(points)


def test_clicks_of_an_earlier_visit_that_the_page_no_longer_shows_do_not_count(lane_run, tmp_path):
    run = shutil.copytree(lane_run, tmp_path / "run")
    looking = Session(open_run(run), n_looks=20).looking
    number = next(n for n, look in enumerate(looking.sample.looks) if look.kind == "moment")
    looking.look(number)
    looking._clicked[number] = [np.array([1, 2, 3])]
    looking.look(number)
    looking.answer(number, "done")
    assert looking.answers[number] == ("done", 0)


def test_recall_waits_for_all_looks_and_precision_does_not(stages):
    sample = draw(stages, Changes(), 20, seed=1)
    told = estimate(sample, {0: ("moving", 0), 1: ("unknown", 0)})
    assert told["precision"]["value"] == 1.0
    assert told["recall"] is None
    assert told["answered"] == {"moving": 1, "fringe": 0, "moment": 0}


def test_too_small_a_sample_is_refused(stages):
    with pytest.raises(InputError, match="--sample 5 is too few looks"):
        draw(stages, Changes(), 5)
