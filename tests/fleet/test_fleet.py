"""What is done next, and what becomes of what is lost or fails, with workers whose answers are made up."""

from collections import Counter
from dataclasses import replace

import pytest

from automos.fleet.fleet import MAX_TRIES, Fleet
from automos.fleet.ledger import Ledger
from automos.fleet.local_pool import Executor
from automos.fleet.orders import Ended, Job, Kind, Order, Recording, Report, State, Unit
from automos.settings import load_settings

DONE = Report(State.DONE, scans=10, place="here")
CUT = Report(State.CUT, scans=10, place="here")


class Scripted(Executor):
    """Answers each order as `answer(order, how often it was given)` says; None: its worker is lost."""

    def __init__(self, answer, slots=2):
        super().__init__(slots, cores=8, max_threads=8)
        self.answer, self.given, self.orders, self.places = answer, Counter(), [], {"here"}
        self._waiting = []

    def submit(self, order: Order) -> None:
        assert len(self._waiting) < self.slots
        self.orders.append(order)
        self._waiting.append(order)

    def wait(self, seconds: float) -> list[Ended]:
        order = self._waiting.pop(0)
        key = (order.recording.name, str(order.unit))
        self.given[key] += 1
        report = self.answer(order, self.given[key])
        return [Ended(order, report, "" if report else "its worker was killed (SIGKILL)")]

    def has(self, place: str) -> bool:
        return place in self.places

    def done(self) -> list[str]:
        return [f"{order.recording.name} {order.unit}" for order in self.orders]


@pytest.fixture
def run(tmp_path):
    """Return a function that labels some recordings with a scripted executor."""

    def run(names: str, executor: Executor, target="/out", source="/logs/"):
        ledger = Ledger(tmp_path / "run.sqlite")
        job = Job(load_settings("default"), target, tmp_path / "work", chunk=4)
        return Fleet([Recording(name, source + name) for name in names], job, executor, ledger).run()

    return run


def test_short_recordings_are_one_unit_each(run):
    executor = Scripted(lambda order, n: DONE)
    outcome = run("abc", executor)
    assert outcome.labelled == ["a", "b", "c"]
    assert outcome.scans == 30
    assert executor.done() == ["a start", "b start", "c start"]


def test_a_long_recording_is_cut_and_its_units_come_before_the_next_recording(run):
    executor = Scripted(lambda o, n: CUT if o.recording.name == "a" and o.unit.kind is Kind.START else DONE, slots=1)
    assert run("ab", executor).labelled == ["a", "b"]
    expected = ["start", "evidence 0:4", "evidence 4:8", "evidence 8:10", "tracks"]
    expected += ["labels 0:4", "labels 4:8", "labels 8:10", "results"]
    assert executor.done() == [f"a {unit}" for unit in expected] + ["b start"]


def test_no_unit_begins_before_all_that_it_needs_is_done(run):
    executor = Scripted(lambda o, n: CUT if o.unit.kind is Kind.START else DONE, slots=5)
    run("a", executor)
    kinds = [order.unit.kind.value for order in executor.orders]
    assert kinds == sorted(kinds, key=[kind.value for kind in Kind].index)


def test_what_is_lost_with_a_worker_is_done_again(run):
    lost = {("a", 1), ("c", 1), ("c", 2)}
    executor = Scripted(lambda o, n: None if (o.recording.name, n) in lost else DONE)
    outcome = run("abc", executor)
    assert sorted(outcome.labelled) == ["a", "b", "c"]
    assert executor.given == {("a", "start"): 2, ("b", "start"): 1, ("c", "start"): 3}


def test_a_recording_that_kills_every_worker_is_given_up_and_the_others_go_on(run):
    outcome = run("abc", Scripted(lambda o, n: None if o.recording.name == "b" else DONE))
    assert sorted(outcome.labelled) == ["a", "c"]
    assert outcome.failed == {"b": f"its worker was killed (SIGKILL); tried {MAX_TRIES} times (start)"}


def test_what_cannot_be_done_is_not_tried_again(run):
    executor = Scripted(lambda o, n: Report(State.FAILED, "scan 4 is cut short") if o.recording.name == "a" else DONE)
    outcome = run("ab", executor)
    assert outcome.failed == {"a": "scan 4 is cut short"}
    assert executor.given[("a", "start")] == 1


def test_when_one_unit_fails_the_others_of_its_recording_are_not_begun(run):
    def answer(order, n):
        if order.unit == Unit(Kind.EVIDENCE, 0, 4):
            return Report(State.FAILED, "no")
        return CUT if order.unit.kind is Kind.START else DONE

    executor = Scripted(answer, slots=1)
    assert run("a", executor).failed == {"a": "no"}
    assert executor.done() == ["a start", "a evidence 0:4"]


def test_a_store_that_fails_for_a_while_is_asked_again_after_the_others(run):
    busy = Report(State.AGAIN, "the store did not answer")
    executor = Scripted(lambda o, n: busy if o.recording.name == "a" and n == 1 else DONE, slots=1)
    assert run("abc", executor).labelled == ["b", "c", "a"]


def test_units_stay_on_the_machine_that_holds_what_the_others_found(run):
    executor = Scripted(lambda o, n: CUT if o.unit.kind is Kind.START else DONE)
    run("a", executor, target="s3://bucket/out")
    assert [order.home for order in executor.orders] == [None] + ["here"] * (len(executor.orders) - 1)
    executor = Scripted(lambda o, n: CUT if o.unit.kind is Kind.START else DONE)
    run("a", executor, target="/shared/out")
    assert {order.home for order in executor.orders} == {None}


def test_a_recording_whose_machine_is_gone_begins_anew_elsewhere(run):
    def answer(order, n):
        if order.unit.kind is Kind.START:
            return replace(CUT, place="here" if n == 1 else "there")
        if order.home == "here" and order.unit.first >= 4:
            executor.places.discard("here")
            return None
        return replace(DONE, place=order.home)

    executor = Scripted(answer)
    outcome = run("a", executor, target="s3://bucket/out")
    assert outcome.labelled == ["a"]
    again = executor.done().index("a start", 1)
    assert {order.home for order in executor.orders[again + 1 :]} <= {"here", "there"}
    assert [order.home for order in executor.orders if order.unit.kind is Kind.RESULTS] == ["there"]


def test_threads_are_shared_by_those_who_work(run):
    executor = Scripted(lambda o, n: DONE, slots=4)
    run("abcdef", executor)
    assert [order.threads for order in executor.orders] == [2, 2, 2, 2, 2, 2]
    executor = Scripted(lambda o, n: DONE, slots=4)
    run("a", executor)
    assert [order.threads for order in executor.orders] == [8]
