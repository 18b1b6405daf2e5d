"""What a person adds, draws, cuts, splits and joins is in the results, and survives other settings and poses."""

import base64
import copy
import json
import shutil
import threading

import numpy as np
import pytest
from browsing import until
from typer.testing import CliRunner

from automos.cli import app
from automos.core.errors import InputError
from automos.core.labels import Label
from automos.objects.verdict import Verdict
from automos.results.open_run import open_run
from automos.review import ahead, queue
from automos.review.ahead import Waiting
from automos.review.amendments import Part, append_verdicts, read_amendments
from automos.review.apply import reapply
from automos.review.log import LOG_FILE, read_lines
from automos.review.reshaping import as_amendment
from automos.review.run_stages import Changes, RunStages
from automos.review.session import Session
from automos.views.ground_map import Thumbnails


@pytest.fixture
def session(lane_run, tmp_path):
    run = shutil.copytree(lane_run, tmp_path / "run")
    return Session(open_run(run, lane_run.parent / "lane"))


def labels_of(run):
    return {p.stem: np.fromfile(p, np.uint32) & 0xFFFF for p in sorted((run / "predictions").iterdir())}


def moving_track(session):
    return int(np.flatnonzero(session.stages.verdicts.verdict == Verdict.MOVING)[0])


def rows_of(session, track):
    return {
        name: np.flatnonzero(session.stages.labels(i)["track"] == track) for i, name in enumerate(session.stages.names)
    }


def miss(session, track):
    """Judge a moving track static, as if the run had missed it; return where to click on it: scan, x, y."""
    session.decide([track + 1], "static")
    rows = session.stages.tracks.rows_of(track)
    seen = np.flatnonzero(session.stages.tracks.is_observed[rows]) + rows.start
    row = seen[len(seen) // 2]
    index = int(session.stages.tracks.scan[row])
    frame, own = session.stages.frame(index), rows_of(session, track)[session.stages.names[index]]
    points = frame.points_level[np.searchsorted(frame.kept, own)]
    nearest = points[np.linalg.norm(points - np.median(points, axis=0), axis=1).argmin()]
    return index, float(nearest[0]), float(nearest[1])


def test_a_cluster_that_is_clicked_is_followed_accepted_and_painted(session):
    track = moving_track(session)
    own = rows_of(session, track)
    index, x, y = miss(session, track)
    shown = session.propose(index, (x, y))
    assert shown["n_scans"] >= 0.8 * sum(len(rows) > 0 for rows in own.values())
    made = session.accept(0, len(session.stages.names))
    session.finish()
    after = labels_of(session.run.folder)
    found = sum(int((after[name][rows] == Label.MOVING).sum()) for name, rows in own.items())
    assert found >= 0.95 * sum(map(len, own.values()))
    entry = next(t for t in json.loads((session.run.folder / "tracks.json").read_text())["tracks"] if t["id"] == made)
    assert (entry["verdict"], entry["made"]) == ("moving", "added")
    assert track + 1 not in {t["id"] for t in json.loads((session.run.folder / "tracks.json").read_text())["tracks"]}


def test_its_beginning_and_end_can_be_set(session):
    track = moving_track(session)
    index, x, y = miss(session, track)
    session.propose(index, (x, y))
    session.accept(index - 1, index + 1)
    (made,) = read_amendments(session.run.folder)
    assert {session.stages.index[name] for name in made.parts} <= {index - 1, index, index + 1}


def test_what_was_made_by_hand_survives_other_settings(session, lane_run):
    track = moving_track(session)
    own = rows_of(session, track)
    index, x, y = miss(session, track)
    session.propose(index, (x, y))
    session.accept(0, len(session.stages.names))
    session.finish()
    before = labels_of(session.run.folder)
    run, recording = session.run.folder, lane_run.parent / "lane"
    options = ["--workers", "1", "--set", "instances.components.min_points=4"]
    done = CliRunner().invoke(app, ["label", str(recording), "--out", str(run), *options])
    assert done.exit_code == 0, done.output
    after = labels_of(run)
    for name, rows in own.items():
        np.testing.assert_array_equal(after[name][rows], before[name][rows])
    assert sum(t.get("made") == "added" for t in json.loads((run / "tracks.json").read_text())["tracks"]) == 1


def test_a_box_that_is_drawn_becomes_an_object_and_two_lead_its_way(session):
    track = moving_track(session)
    miss(session, track)
    tracks = session.stages.tracks
    rows = np.arange(len(tracks.track))[tracks.rows_of(track)]
    first, last = rows[1], rows[-2]
    drawn = {
        int(tracks.scan[row]): [*tracks.center[row, :2], *(tracks.size[row, :2] + 0.6), tracks.yaw[row]]
        for row in (first, last)
    }
    shown = session.propose(boxes=drawn)
    session.accept(0, len(session.stages.names))
    session.finish()
    assert shown["n_scans"] == tracks.scan[last] - tracks.scan[first] + 1
    own, after = rows_of(session, track), labels_of(session.run.folder)
    between = session.stages.names[tracks.scan[first] : tracks.scan[last] + 1]
    found = sum(int((after[name][own[name]] == Label.MOVING).sum()) for name in between)
    assert found >= 0.7 * sum(len(own[name]) for name in between)


@pytest.mark.parametrize("where", [{"index": 0, "at": (500.0, 500.0)}, {"boxes": {0: [500.0, 500.0, 2.0, 2.0, 0.0]}}])
def test_where_nothing_stands_it_is_said(session, where):
    with pytest.raises(InputError, match="nothing stands"):
        session.propose(**where)


def test_what_moves_already_is_not_added_twice(session):
    track = moving_track(session)
    rows = session.stages.tracks.rows_of(track)
    index = int(session.stages.tracks.scan[rows.start + 3])
    frame, own = session.stages.frame(index), rows_of(session, track)[session.stages.names[index]]
    x, y = frame.points_level[np.searchsorted(frame.kept, own[0]), :2]
    with pytest.raises(InputError, match="moves already"):
        session.propose(index, (float(x), float(y)))


def test_what_moves_is_cut_by_the_labels_that_it_has_and_they_are_not_made_anew(session, monkeypatch):
    track = moving_track(session)
    painted = as_amendment(session.stages, track, Changes({track: "moving"}))
    monkeypatch.setattr(RunStages, "painted", lambda *given: pytest.fail("a scan is labelled again"))
    found = as_amendment(session.stages, track, Changes())
    assert {name: part.rows.tolist() for name, part in found.parts.items()} == {
        name: part.rows.tolist() for name, part in painted.parts.items()
    }


def test_a_track_is_cut_at_a_time_and_each_half_is_decided_on_alone(session):
    track = moving_track(session)
    own = rows_of(session, track)
    scans = [session.stages.index[name] for name, rows in own.items() if len(rows)]
    at = scans[len(scans) // 2]
    before, after = session.cut(track + 1, at)
    session.decide([after], "static")
    session.finish()
    labels = labels_of(session.run.folder)
    for name, rows in own.items():
        expected = Label.MOVING if session.stages.index[name] < at else Label.STATIC
        assert (labels[name][rows] == expected).all()
    tracks = {t["id"]: t for t in json.loads((session.run.folder / "tracks.json").read_text())["tracks"]}
    assert (
        max(box["scan"] for box in tracks[before]["boxes"]) < at <= min(box["scan"] for box in tracks[after]["boxes"])
    )


def test_halves_are_joined_again_and_everything_taken_back_brings_back_every_label(session):
    track = moving_track(session)
    found = labels_of(session.run.folder)
    halves = session.cut(track + 1, int(session.stages.tracks.scan[session.stages.tracks.rows_of(track).start + 5]))
    whole = session.join(halves)
    session.finish()
    for name, labels in labels_of(session.run.folder).items():
        np.testing.assert_array_equal(labels, found[name])
    assert {one.how for one in session.changes.amendments} == {"joined"}
    session.decide([whole], "undo")
    session.finish()
    assert session.changes.amendments == []
    assert track + 1 in {t["id"] for t in json.loads((session.run.folder / "tracks.json").read_text())["tracks"]}


def test_a_track_is_split_by_a_box_that_goes_along_with_it(session):
    track = moving_track(session)
    own = rows_of(session, track)
    tracks = session.stages.tracks
    row = tracks.rows_of(track).start + 4
    c, s = np.cos(tracks.yaw[row]), np.sin(tracks.yaw[row])
    ahead = tracks.center[row, :2] + 0.5 * tracks.size[row, 0] * np.array([c, s])  # the half in front
    box = [*ahead, tracks.size[row, 0], tracks.size[row, 1] + 1.0, tracks.yaw[row]]
    front, rest = session.split(track + 1, int(tracks.scan[row]), box)
    parts = {session.number(one): one.parts for one in session.changes.amendments}
    n_front, n_rest = (sum(len(part.rows) for part in parts[one].values()) for one in (front, rest))
    assert n_front + n_rest == sum(map(len, own.values()))
    assert min(n_front, n_rest) > 0.1 * (n_front + n_rest)
    with pytest.raises(InputError, match="the box must hold a part"):
        session.split(front, int(tracks.scan[row]), [500.0, 500.0, 1.0, 1.0, 0.0])


def test_a_part_is_where_it_was_whatever_the_poses():
    rows, box = np.array([5, 2, 9]), np.array([3.0, 4.0, 1.0, 4.0, 2.0, 1.5, 0.7])
    T = np.eye(4)
    part = Part.of_box(rows, box, T)
    np.testing.assert_allclose(part.box_level(T), box)
    np.testing.assert_array_equal(part.rows, [2, 5, 9])
    turned = np.array([[0.0, -1, 0, 10], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    np.testing.assert_allclose(part.box_level(turned), [6.0, 3.0, 1.0, 4.0, 2.0, 1.5, 0.7 + np.pi / 2])


def test_a_damaged_line_of_an_object_is_named(session, caplog):
    (session.run.folder / LOG_FILE).write_text(
        '{"kind": "amendment", "key": "h1", "verdict": "moving", "parts": {"0": 3}}\n'
    )
    assert read_amendments(session.run.folder) == []
    assert "line 1 is not an object made by hand" in caplog.text


def test_the_list_holds_four_fifths_of_the_doubtful_points_and_what_is_sure_is_not_in_it(session):
    page = session.overview()
    assert [item["core"] for item in page["items"]] == [k < page["enough"] for k in range(len(page["items"]))]
    core = sum(item["doubtful"] for item in page["items"] if item["core"])
    assert core >= 0.8 * page["doubtful"] - 0.1 * len(page["items"])
    fewer = sum(item["doubtful"] for item in page["items"][: page["enough"] - 1])
    assert fewer < 0.8 * page["doubtful"] + 0.1 * len(page["items"])
    assert not any(item["core"] for item in page["items"] if item["doubtful"] == 0.0)


def test_a_scan_comes_with_the_boxes_of_its_objects_found_and_made(session):
    track = moving_track(session)
    scans = session.stages.tracks.scan[session.stages.tracks.rows_of(track)]
    index = int(scans[len(scans) // 2])
    before = {one: box for one, *box in session.place(index)["boxes"]}
    here = session.stages.tracks.track[session.stages.tracks.scan == index] + 1
    assert set(before) == set(here.tolist())
    _, after = session.cut(track + 1, index)
    now = {one: box for one, *box in session.place(index)["boxes"]}
    assert set(now) == set(before) - {track + 1} | {after}
    np.testing.assert_allclose(now[after][:4], before[track + 1][:4], atol=0.01)


def test_where_there_is_truth_the_gain_is_that_of_evaluate(session):
    from automos.evaluation.report import evaluate_folder

    run, gain = session.run, session.gain
    gain.count()
    before = evaluate_folder(run.folder / "predictions", run.sequence).counts.scores.iou
    assert session.status()["iou"] == {"found": before, "now": before}
    session.decide([moving_track(session) + 1], "static")
    session.finish()
    after = evaluate_folder(run.folder / "predictions", run.sequence).counts.scores.iou
    assert after < before
    assert session.status()["iou"] == {"found": before, "now": after}


def test_what_is_made_by_hand_has_a_picture_in_the_list_at_once(session):
    track = moving_track(session)
    scans = session.stages.tracks.scan[session.stages.tracks.rows_of(track)]
    ids = session.cut(track + 1, int(scans[len(scans) // 2]))
    shown = session.pictures_now()["pictures"]
    assert all(base64.b64decode(shown[id]["points"]) for id in ids)


def test_what_is_in_sight_has_its_picture_before_all_scans_are_read(session, monkeypatch):
    first = next(item["id"] for item in session.overview()["items"] if "id" in item)
    entry = next(track for track in session.run.tracks_file["tracks"] if track["id"] == first)
    n, goes_on, asked, run = len(Thumbnails([entry]).scans), threading.Event(), [], copy.copy(session.run)

    def scan(index):
        asked.append(index)
        if len(asked) > n:
            goes_on.wait(60)
        return session.run.scan(index)

    monkeypatch.setattr(ahead, "IN_SIGHT", 1)
    run.scan = scan
    made = ahead.Pictures(run, session.stages, session.queue, Waiting())
    shown = until(lambda: (page := made.to_page([]))["pictures"] and page)
    assert (list(shown["pictures"]), shown["ready"]) == ([first], False)
    goes_on.set()
    until(lambda: made.to_page([])["ready"])
    assert len(made.to_page([])["pictures"]) == len(session.stages.tracks)


def test_an_object_taken_back_is_taken_out_of_the_labels_when_the_session_ended_before(session):
    track = moving_track(session)
    before = {name: labels.tolist() for name, labels in labels_of(session.run.folder).items()}
    index, x, y = miss(session, track)
    session.propose(index, (x, y))
    session.accept(0, len(session.stages.names), "static")
    session.decide([track + 1], "undo")
    session.finish()
    (made,) = read_amendments(session.run.folder)
    append_verdicts(session.run.folder, made.at, {made.key: "undo"})  # the session was killed before it was written
    reapply(session.run.folder, session.run.sequence)
    assert {name: labels.tolist() for name, labels in labels_of(session.run.folder).items()} == before


def test_the_log_is_read_once_for_all_places(session, monkeypatch):
    place = {"sentence": "?", "track": 1, "at": [0, 0], "points": 9}
    session.queue.places = [{**place, "place": k, "scan": session.stages.names[k], "rows": [k]} for k in range(5)]
    session.dismiss(3)
    reads = []
    monkeypatch.setattr(queue, "read_lines", lambda *args: reads.append(args) or read_lines(*args))
    rows = {row["place"]: row["decided"] for row in session.overview()["items"] if "place" in row}
    assert rows == {0: None, 1: None, 2: None, 3: "done", 4: None}
    assert len(reads) == 1


def test_an_object_whose_scans_were_removed_leaves_results_that_can_be_read(session, lane_run, tmp_path):
    folder, names = session.run.folder, session.stages.names
    track = moving_track(session)
    session.cut(track + 1, int(session.stages.tracks.scan[session.stages.tracks.rows_of(track).stop - 3]))
    session.finish()
    recording = shutil.copytree(lane_run.parent / "lane", tmp_path / "shorter")
    _, late = sorted(read_amendments(folder), key=lambda one: min(one.parts))
    first = min(late.parts)
    for name in names[names.index(first) :]:
        for part in ("velodyne", "labels"):
            next((recording / part).glob(f"{name}.*")).unlink()
    (recording / "times.txt").unlink()
    done = CliRunner().invoke(app, ["label", str(recording), "--out", str(folder), "--workers", "1"])
    assert done.exit_code == 0, done.output
    run = open_run(folder)
    assert sum("made" in track for track in run.tracks_file["tracks"]) == 1
    assert f"(scans {first} to {max(late.parts)}) finds no such scan in this run" in " ".join(done.output.split())
    assert len(read_amendments(folder)) == 2  # both stay in the log


def test_of_one_more_object_only_its_own_scans_are_looked_at(session, monkeypatch):
    track = moving_track(session)
    halves = session.cut(track + 1, int(session.stages.tracks.scan[session.stages.tracks.rows_of(track).start + 5]))
    seen = []
    monkeypatch.setattr(queue, "replaced", lambda stages, index, changes: seen.append(index) or [])
    session.decide(halves, "static")
    assert seen == []
    session.decide([halves[0]], "undo")
    assert seen == []
    session.cut(halves[1], int(session.stages.tracks.scan[session.stages.tracks.rows_of(track).stop - 2]))
    assert min(seen) >= session.stages.tracks.scan[session.stages.tracks.rows_of(track).start + 5]
