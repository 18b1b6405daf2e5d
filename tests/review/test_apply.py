"""Decisions change labels, tracks and counts as the pipeline would have, and hold in later runs."""

import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from automos.cli import app
from automos.core.atomic import held
from automos.core.errors import InputError
from automos.core.labels import Label
from automos.core.workspace import Workspace
from automos.objects.verdict import Verdict
from automos.readers import open_sequence
from automos.results.open_run import open_run
from automos.results.run_files import RunFiles
from automos.review import apply
from automos.review.apply import reapply, rewrite_scan
from automos.review.decisions import Cover, Decision, append_decisions, cover_tracks, match, read_decisions
from automos.review.log import key_of_changes
from automos.review.run_stages import Changes, RunStages, decided_labels

AT = "2026-01-02T03:04:05+00:00"


@pytest.fixture
def run(lane_run, tmp_path):
    """Return a run's folder to change."""
    return shutil.copytree(lane_run, tmp_path / "run")


@pytest.fixture(scope="module")
def recording(lane_run):
    return lane_run.parent / "lane"


def stages_of(run, recording):
    return RunStages(run, open_sequence(recording))


def decide(stages, track, verdict, tracking=None):
    """Log that `track` (index, from 0) is `verdict`, as of another run where `tracking` is given."""
    key = tracking or stages.keys["tracking"]
    found = Verdict(stages.verdicts.verdict[track]).name.lower()
    append_decisions(stages.folder, [Decision(AT, track + 1, verdict, found, key, cover_of(stages, track))])


def cover_of(stages, track):
    return cover_tracks(stages, [track])[track]


def files_of(run):
    return {path.name: path.read_bytes() for path in (run / "predictions").iterdir()}


def labels_of(run):
    return {name: np.frombuffer(raw, np.uint32) & 0xFFFF for name, raw in files_of(run).items()}


def moving_track(stages):
    return int(np.flatnonzero(stages.verdicts.verdict == Verdict.MOVING)[0])


def points_of(stages, track):
    return {f"{name}.label": stages.labels(i)["track"] == track for i, name in enumerate(stages.names)}


@pytest.mark.parametrize(("verdict", "label"), [("static", Label.STATIC), ("unknown", Label.UNLABELED)])
def test_the_points_of_a_decided_track_change_and_no_others(run, recording, verdict, label):
    stages = stages_of(run, recording)
    track = moving_track(stages)
    before, own = labels_of(run), points_of(stages, track)
    decide(stages, track, verdict)
    told = reapply(run, open_sequence(recording))
    after = labels_of(run)
    assert sum(mask.sum() for mask in own.values()) > 50
    for name, mask in own.items():
        assert (after[name][mask] == label).all()
        np.testing.assert_array_equal(after[name][~mask], before[name][~mask])
    counted = {kind.name.lower(): sum(int((labels == kind).sum()) for labels in after.values()) for kind in Label}
    assert told["points"] == counted == json.loads((run / "run.json").read_text())["points"]


def test_what_the_pipeline_missed_is_painted_as_it_would_have_painted_it(run, recording):
    stages = stages_of(run, recording)
    track = moving_track(stages)
    before = files_of(run)
    tracking = stages.stage("tracking").load("all")
    tracking["verdict"][track] = Verdict.STATIC
    stages.stage("tracking").save("all", tracking)
    for i, name in enumerate(stages.names):
        rewrite_scan(stages, i, Changes({track: "static"}))
        stages.stage("labels").save(name, decided_labels(stages, i, {track: "static"}))
    assert files_of(run) != before
    decide(stages_of(run, recording), track, "moving")
    reapply(run, open_sequence(recording))
    assert files_of(run) == before


def test_tracks_json_tells_the_decision_and_what_was_found(run, recording):
    stages = stages_of(run, recording)
    track = moving_track(stages)
    found = json.loads((run / "tracks.json").read_text())["tracks"][track]
    decide(stages, track, "static")
    told = reapply(run, open_sequence(recording))
    now = json.loads((run / "tracks.json").read_text())["tracks"][track]
    assert (now["verdict"], now["confidence"]) == ("static", 1.0)
    assert now["found"] == {"verdict": "moving", "confidence": found["confidence"]}
    assert now["boxes"] == found["boxes"]
    assert told["review"] == {"decisions": 1, "made": 0, "lost": [], "applied": key_of_changes(run)}
    assert told["tracks"]["moving"] == int((stages.verdicts.verdict == Verdict.MOVING).sum()) - 1


def test_applying_twice_changes_nothing_more_and_undo_brings_back_every_file(run, recording):
    stages = stages_of(run, recording)
    track = moving_track(stages)
    before, tracks = files_of(run), json.loads((run / "tracks.json").read_text())
    decide(stages, track, "static")
    reapply(run, open_sequence(recording))
    once = files_of(run)
    reapply(run, open_sequence(recording))
    assert files_of(run) == once != before
    decide(stages, track, "undo")
    rerun(run, recording)
    assert files_of(run) == before
    assert json.loads((run / "tracks.json").read_text()) == tracks


def rerun(run, recording, *options):
    done = CliRunner().invoke(app, ["label", str(recording), "--out", str(run), "--workers", "1", *options])
    assert done.exit_code == 0, done.output
    return done.output


def test_decisions_hold_when_the_recording_is_labelled_again_with_other_settings(run, recording):
    stages = stages_of(run, recording)
    track = moving_track(stages)
    own = points_of(stages, track)
    decide(stages, track, "static")
    rerun(run, recording, "--set", "instances.components.min_points=4")
    again = stages_of(run, recording)
    assert again.keys["tracking"] != stages.keys["tracking"]
    decided, lost = match(again, read_decisions(run))
    assert len(decided) >= 1
    assert not lost
    after = labels_of(run)
    still_moving = sum(int((after[name][mask] == Label.MOVING).sum()) for name, mask in own.items())
    assert still_moving == 0


def test_a_decision_follows_its_points_when_the_numbers_of_tracks_change(run, recording):
    stages = stages_of(run, recording)
    assert len(stages.tracks) > 1
    for track in range(len(stages.tracks)):
        covers = cover_of(stages, track)
        wrong_number = (track + 1) % len(stages.tracks) + 1
        decision = Decision(AT, wrong_number, "moving", "static", "of another run", covers)
        assert match(stages, [decision]) == ({track: "moving"}, [])


def test_a_decision_is_not_taken_over_by_what_brushed_past_once(run, recording):
    stages = stages_of(run, recording)
    track = moving_track(stages)
    covers = cover_of(stages, track)
    first, *others = sorted(covers)[:4]
    nobodys = {}
    for name in others:
        i = stages.names.index(name)
        nobodys[name] = Cover(3, stages.frame(i).kept[np.flatnonzero(stages.track_of_points(i) < 0)[:3]].tolist())
    of_another = Decision(AT, 1, "unknown", "static", "another run", {first: covers[first], **nobodys})
    assert match(stages, [of_another]) == ({}, [of_another])
    of_its_own = Decision(AT, 1, "unknown", "static", "another run", {name: covers[name] for name in (first, *others)})
    assert match(stages, [of_its_own]) == ({track: "unknown"}, [])


def test_a_decision_that_finds_no_track_is_told_in_a_sentence_and_stays_in_the_log(run, recording):
    stages = stages_of(run, recording)
    nowhere = {stages.names[0]: cover_of(stages, moving_track(stages))[stages.names[-1]]}
    covered = Decision(AT, 4, "moving", "static", "of another run", nowhere)
    append_decisions(run, [covered])
    output = " ".join(rerun(run, recording).split())
    assert "warning: The decision of 2026-01-02T03:04:05+00:00 that object 4" in output
    assert "finds no such object in this run; it stays in the log" in output
    assert read_decisions(run) == [covered]


def test_later_decisions_replace_earlier_ones(run, recording):
    stages = stages_of(run, recording)
    for verdict in ("static", "unknown"):
        decide(stages, 0, verdict)
    assert match(stages, read_decisions(run)) == ({0: "unknown"}, [])


def test_a_run_whose_stages_were_deleted_is_labelled_again_first(run, recording):
    shutil.rmtree(run / "stages")
    with pytest.raises(InputError, match="run automos label again with --out"):
        stages_of(run, recording)


def test_painting_a_scan_without_decisions_gives_what_the_pipeline_wrote(run, recording):
    stages = stages_of(run, recording)
    before = files_of(run)
    same = {k: Verdict(v).name.lower() for k, v in enumerate(stages.verdicts.verdict)}
    for i in range(len(stages.names)):
        rewrite_scan(stages, i, Changes(same))
    assert files_of(run) == before


def test_no_review_is_begun_while_somebody_writes_into_the_results(run):
    pytest.importorskip("fcntl", reason="Windows has no locks on folders")
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    with held(run):
        ended = CliRunner().invoke(app, ["review", str(run), "--no-browser", "--port", "0"])
    assert isinstance(ended.exception, InputError)
    assert "another process writes into" in str(ended.exception)
    assert {path: path.read_bytes() for path in run.rglob("*") if path.is_file()} == before


def test_what_was_taken_back_is_taken_out_of_the_labels_when_the_session_ended_before(run, recording):
    stages = stages_of(run, recording)
    track = moving_track(stages)
    before = files_of(run)
    decide(stages, track, "static")
    reapply(run, open_sequence(recording))
    assert files_of(run) != before
    decide(stages, track, "undo")  # logged at once; the session was killed before it was written
    reapply(run, open_sequence(recording))
    assert files_of(run) == before


def judged_standing(run, recording, track):
    """Label the recording again as if its track had been judged to stand: all that stands here is scenery."""
    (folder,) = (run / "stages").glob("tracking-*")
    arrays = dict(np.load(folder / "all.npz"))
    arrays["verdict"][track] = Verdict.STATIC
    Workspace(run).stage(*folder.name.split("-")).save("all", arrays)
    shutil.rmtree(next((run / "stages").glob("labels-*")))
    rerun(run, recording)
    return stages_of(run, recording)


def test_the_objects_of_points_are_those_decided_on_in_exports_too(run, recording):
    track = moving_track(stages_of(run, recording))
    stages = judged_standing(run, recording, track)
    assert stages.verdicts.verdict[track] == Verdict.STATIC
    decide(stages, track, "moving")
    reapply(run, open_sequence(recording))
    found = RunFiles(run, open_sequence(recording))
    ids = np.concatenate([found.instances(i, len(found.scan(i))) for i in range(len(found))])
    moves = np.concatenate([found.labels(i, len(found.scan(i))) for i in range(len(found))]) == Label.MOVING
    assert (ids == track + 1).sum() > 20
    assert (ids[moves] > 0).all()
    decide(stages, track, "undo")
    rerun(run, recording)
    found = RunFiles(run, open_sequence(recording))
    assert not any((found.instances(i, len(found.scan(i))) == track + 1).any() for i in range(len(found)))


@pytest.mark.parametrize("place", ["automos.results.writing.write_points", "automos.review.apply.rewrite_scan"])
def test_a_run_cut_off_before_its_decisions_were_applied_is_not_taken_for_whole(run, recording, monkeypatch, place):
    stages = stages_of(run, recording)
    decide(stages, moving_track(stages), "static")
    reapply(run, open_sequence(recording))
    wanted = files_of(run)

    def cut_off(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(place, cut_off)
        assert CliRunner().invoke(app, ["label", str(recording), "--out", str(run), "--workers", "1"]).exit_code == 130
    with pytest.raises(InputError, match="without decisions of its review"):
        open_run(run)
    rerun(run, recording)
    assert files_of(run) == wanted
    assert len(open_run(run)) == len(stages.names)


def test_of_a_long_recording_only_what_was_written_again_is_counted_again():
    a_day = 24 * 3600 * 10
    assert apply._counts_of.cache_info().maxsize >= a_day
