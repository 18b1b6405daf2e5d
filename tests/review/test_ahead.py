"""Proposals are made once and ahead of time, give way to what a person waits for, and are as new as her decisions."""

import json
import shutil
import threading
import time
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from browsing import until

from automos.core import workspace
from automos.core.errors import InputError
from automos.core.workspace import UNFINISHED, Workspace
from automos.objects.verdict import Verdict
from automos.results.open_run import open_run
from automos.review import session as session_module
from automos.review.ahead import Waiting
from automos.review.box_rows import as_rows
from automos.review.log import append_lines, now
from automos.review.proposals import Proposer
from automos.review.queue import Queue
from automos.review.session import Session


@pytest.fixture
def session(lane_run, tmp_path):
    run = shutil.copytree(lane_run, tmp_path / "run")
    session = Session(open_run(run, lane_run.parent / "lane"))
    yield session
    session.close()


class Missed:
    """A mover that was judged static, as what may be asked for: counts the scans sought in, and waits in each."""

    def __init__(self, session, after=0):
        moving = np.flatnonzero(session.stages.verdicts.verdict == Verdict.MOVING)
        self.track = int(moving[0]) + 1
        session.decide([self.track], "static")
        tracks = session.stages.tracks
        seen = np.flatnonzero(tracks.is_observed & (tracks.track == self.track - 1))
        row = seen[len(seen) // 2 + after]
        self.place = {"scan": session.stages.names[tracks.scan[row]], "segment": int(tracks.segment[row])}
        self.where = int(tracks.scan[row]), self.place["segment"]
        self.n, self.has_begun, self.may_go_on = 0, threading.Event(), threading.Event()
        self.may_go_on.set()

    def __call__(self, proposer, on_scan):
        way = proposer.from_segment(*self.where, on_scan)

        def held(i):
            found = way.held(i)
            self.n += 1
            self.has_begun.set()
            assert self.may_go_on.wait(60)
            return found

        return replace(way, held=lru_cache(None)(held))


def nothing(*given):
    raise InputError("what stands there moves already")


class Asking(threading.Thread):
    """Somebody who waits for a proposal."""

    def __init__(self, session, what):
        super().__init__(daemon=True)
        self.session, self.what, self.found, self.error = session, what, None, None
        self.start()

    def run(self):
        try:
            self.found = self.session.proposals.get((self.what,))
        except InputError as error:
            self.error = str(error)

    def done(self):
        self.join(60)
        assert not self.is_alive()
        return self


def test_two_who_ask_for_the_same_wait_for_one_and_have_the_same(session):
    missed = Missed(session)
    missed.may_go_on.clear()
    first = Asking(session, missed)
    assert missed.has_begun.wait(60)
    second = Asking(session, missed)
    until(lambda: session._waiting._n == 2)
    missed.may_go_on.set()
    found, _ = first.done().found
    assert second.done().found[0] is found
    assert missed.n == len(found.parts)


def test_what_comes_next_is_made_before_it_is_asked_for(session):
    missed = Missed(session)
    session.proposals.make_ahead([(missed,)])
    until(lambda: not session.proposals._ahead)
    n = missed.n
    assert n > 0
    found, shown = session.proposals.get((missed,))
    assert missed.n == n == len(found.parts)
    assert [one["index"] for one in shown["moments"]]


def test_what_was_made_ahead_is_as_new_as_the_last_decision(session):
    missed = Missed(session)
    session.proposals.make_ahead([(missed,)])
    until(lambda: not session.proposals._ahead)
    before, _ = session.proposals.get((missed,))
    session.decide([missed.track], "moving")
    with pytest.raises(InputError, match="moves already"):
        session.proposals.get((missed,))
    session.decide([missed.track], "static")
    after, _ = session.proposals.get((missed,))
    assert {name: part.rows.tolist() for name, part in after.parts.items()} == {
        name: part.rows.tolist() for name, part in before.parts.items()
    }


def test_a_decision_that_comes_while_it_is_made_holds_for_it(session):
    missed = Missed(session)
    missed.may_go_on.clear()
    asking = Asking(session, missed)
    assert missed.has_begun.wait(60)
    session.decide([missed.track], "moving")
    missed.may_go_on.set()
    assert "moves already" in asking.done().error


def test_what_was_added_is_not_proposed_again(session):
    session.queue.places = [{**Missed(session).place, "place": 0, "rows": [0], "points": 9}]
    session.propose(number=0)
    session.accept(0, len(session.stages.names))
    with pytest.raises(InputError, match="nothing is proposed"):
        session.accept(0, len(session.stages.names))
    with pytest.raises(InputError, match="moves already"):
        session.propose(number=0)


def test_what_is_decided_between_proposal_and_acceptance_is_taken_out(session):
    missed = Missed(session)
    session.queue.places = [{**missed.place, "place": 0, "rows": [0], "points": 9}]
    session.propose(number=0)
    session.decide([missed.track], "moving")
    with pytest.raises(InputError, match="moves already"):
        session.accept(0, len(session.stages.names))
    assert session.changes.amendments == []


def test_a_glance_reads_the_scans_around_alone_and_the_rest_is_followed_after_it(session, monkeypatch):
    missed, read, load = Missed(session), set(), workspace._FolderStage.load
    session.queue.places = [{**missed.place, "place": 0, "rows": [0], "points": 9}]
    session._near._most = 3
    monkeypatch.setattr(workspace._FolderStage, "load", lambda *given: read.add(given[1]) or load(*given))
    found = session.propose(number=0, is_glance=True)
    assert read <= {session.stages.names[missed.where[0] + by] for by in range(-2, 3)}
    assert (found["is_whole"], found["n_scans"]) == (False, 5)
    with pytest.raises(InputError, match="nothing is proposed"):
        session.accept(0, len(session.stages.names))
    whole = session.propose(number=0)
    assert whole["is_whole"]
    assert whole["n_scans"] > 5
    read.clear()
    assert session.propose(number=0, is_glance=True) == whole
    assert not read


def test_a_glance_between_boxes_that_finds_nothing_goes_farther_and_another_says_so_at_once(session, monkeypatch):
    missed, tracks, boxes = Missed(session), session.stages.tracks, {}
    for row in np.flatnonzero(tracks.is_observed & (tracks.track == missed.track - 1))[[0, -1]]:
        x, y, _, length, width, _, yaw = as_rows(tracks[[row]].boxes)[0].tolist()
        boxes[int(tracks.scan[row])] = [x, y, length, width, yaw]
    monkeypatch.setattr(session_module, "proposed", nothing)
    assert session.propose(boxes=boxes, is_glance=True)["is_whole"]
    session.queue.places = [{**missed.place, "place": 0, "rows": [0], "points": 9}]
    with pytest.raises(InputError, match="moves already"):
        session.propose(number=0, is_glance=True)
    assert missed.where not in [what[1:] for what in session.proposals._kept]


@pytest.mark.parametrize("is_cancelled", [True, False])
def test_what_nobody_waits_for_any_more_is_given_up(session, is_cancelled):
    missed, other = Missed(session), Missed(session, 1)
    missed.may_go_on.clear()
    asking = Asking(session, missed)
    assert missed.has_begun.wait(60)
    assert 0 < session.proposals.progress()["scans"] < session.proposals.progress()["of"]
    if is_cancelled:
        session.proposals.cancel()
    else:
        assert session.proposals.get((other,))[0].parts
    missed.may_go_on.set()
    assert "no longer followed" in asking.done().error
    assert missed.n == 1
    found, _ = session.proposals.get((missed,))  # what was found of it so far is not sought again
    assert missed.n == len(found.parts)


def test_what_is_made_ahead_gives_way_and_goes_on_where_it_was(session):
    ahead, asked = Missed(session), Missed(session, 1)
    ahead.may_go_on.clear()
    session.proposals.make_ahead([(ahead,)])
    assert ahead.has_begun.wait(60)
    asked.may_go_on.clear()
    asking = Asking(session, asked)
    assert asked.has_begun.wait(60)
    ahead.may_go_on.set()
    time.sleep(0.5)
    assert ahead.n == 1
    asked.may_go_on.set()
    asking.done()
    until(lambda: not session.proposals._ahead)
    assert ahead.n == len(session.proposals.get((ahead,))[0].parts)


def test_what_is_no_longer_next_is_not_made(session):
    first, second = Missed(session), Missed(session, 1)
    first.may_go_on.clear()
    session.proposals.make_ahead([(first,), (second,)])
    assert first.has_begun.wait(60)
    session.proposals.make_ahead([])
    first.may_go_on.set()
    until(lambda: not session.proposals._kept[(first,)].lock.locked())
    assert (first.n, second.n) == (1, 0)


def test_objects_scans_and_pictures_are_shown_while_something_is_followed(session):
    missed = Missed(session)
    missed.may_go_on.clear()
    asking = Asking(session, missed)
    assert missed.has_begun.wait(60)
    assert session.scene(1)["track"] == 1
    assert session.place(0)["index"] == 0
    session.pictures_now()
    session.decide([missed.track], "unknown")
    assert asking.is_alive()
    missed.may_go_on.set()
    asking.done()


def test_places_are_numbered_as_they_are_listed_whatever_else_is_worth_knowing(session):
    place = {**Missed(session).place, "kind": "lost", "sentence": "?", "track": 1, "at": [0, 0], "points": 9}
    queue = Queue(session.stages, [{"kind": "camera", "sentence": "The poses are a camera's."}, place])
    session.queue = queue
    (row,) = [row for row in session.overview()["items"] if "place" in row]
    session.make_ahead([row["place"]])
    until(lambda: not session.proposals._ahead)
    assert list(session.proposals._kept) == [
        (Proposer.from_segment, session.stages.index[place["scan"]], place["segment"])
    ]
    assert session.propose(number=row["place"])["n_scans"] > 1
    session.dismiss(row["place"])
    assert json.loads((session.run.folder / "review.jsonl").read_text().splitlines()[-1])["scan"] == place["scan"]


def test_what_goes_on_beside_gives_way_while_somebody_waits():
    waiting, done = Waiting(), threading.Event()
    with waiting, waiting:
        threading.Thread(target=lambda: waiting.give_way() or done.set(), daemon=True).start()
        waiting.give_way(unless=lambda: True)
        assert not done.wait(0.2)
    assert done.wait(60)


def test_what_is_in_the_results_already_is_not_applied_again_and_what_is_not_is(session, monkeypatch):
    applied = []
    monkeypatch.setattr(session_module, "reapply", lambda folder, *_: applied.append(folder))
    run = session.run
    session.decide([1], "unknown")
    Session(run).close()  # it is logged, and not yet known to be written
    assert applied == [run.folder]
    session.finish()
    Session(run).close()
    assert len(applied) == 1
    append_lines(run.folder, [{"kind": "dismissed", "at": now(), "scan": session.stages.names[0], "row": 0}])
    Session(run).close()
    assert len(applied) == 1
    record = Workspace(run.folder).read_run()
    (run.folder / "run.json").write_text(json.dumps({**record, UNFINISHED: True}))  # labelling again was cut off
    Session(run).close()
    assert len(applied) == 2
