"""The books of a run, and what is read from them."""

import json
import sqlite3
import time

import pytest

from automos.cli.options import output
from automos.core.errors import InputError
from automos.fleet.ledger import Ledger, ledger_name
from automos.fleet.orders import Job, Order, Recording, Report, State, Unit
from automos.fleet.status import Status, read_status
from automos.settings import load_settings

RECORDINGS = [Recording(name, f"/logs/{name}") for name in ("a", "b", "c")]
DONE = Report(State.DONE, scans=10, points=1000, moving=50, seconds=5.0, cpu_seconds=4.0, peak_mb=300.0)


@pytest.fixture
def job(tmp_path):
    return Job(load_settings("default"), str(tmp_path), tmp_path / "work")


def begun(path, recordings=RECORDINGS) -> Ledger:
    ledger = Ledger(path)
    ledger.begin(recordings, "key", "settings: all\n", {"automos": "0"}, 2)
    return ledger


def label(ledger: Ledger, job: Job, recording: Recording, report: Report = DONE) -> None:
    order = Order(job, recording)
    ledger.started(order, 1)
    ledger.ended(order, report)
    ledger.labelled(recording, report)


def test_what_was_done_is_told_and_what_failed_with_its_reason(tmp_path, job):
    ledger = begun(tmp_path / "ledger" / "run.sqlite")
    label(ledger, job, RECORDINGS[0])
    ledger.failed(RECORDINGS[1], "its scan is cut short", "")
    ledger.started(Order(job, RECORDINGS[2], Unit()), 1)
    status = read_status(str(tmp_path))
    assert [status.count(state) for state in ("done", "failed", "running", "waiting")] == [1, 1, 1, 0]
    assert status.failures == [("b", "its scan is cut short")]
    text = "\n".join(status.lines())
    assert "1 of 3 recordings labelled, 1 running, 0 waiting, 1 failed" in text
    assert "10 scans, 1,000 points, 50 moving" in text
    assert "0.400 CPU s per scan, workers of at most 300 MB" in text
    assert "not labelled: b: its scan is cut short" in text
    assert json.loads(status.to_json())["recordings"][0]["fingerprint"] == ""


def test_rate_and_time_left_follow_from_what_was_labelled_since_the_start():
    hour_ago = 1_000_000.0
    run = {"started": hour_ago, "seen": hour_ago + 3600, "ended": None}
    rows = [{"state": "done", "fresh": 1, "ended": hour_ago + 600 * k} for k in range(1, 7)]
    rows += [{"state": "done", "fresh": 0, "ended": hour_ago + 5}, {"state": "waiting"}, {"state": "running"}]
    status = Status(rows, [], [run], now=hour_ago + 3600)
    assert status.is_at_work
    assert status.rate == pytest.approx(6.0)
    assert status.seconds_left == pytest.approx(1200.0)
    assert not Status(rows, [], [run], now=hour_ago + 9000).is_at_work


def test_what_runs_when_the_books_are_closed_waits_again(tmp_path, job):
    path = tmp_path / "ledger" / "run.sqlite"
    ledger = begun(path)
    label(ledger, job, RECORDINGS[0])
    ledger.started(Order(job, RECORDINGS[1]), 1)
    ledger.close()
    status = read_status(str(tmp_path))
    assert (status.count("done"), status.count("waiting")) == (1, 2)
    assert "repeat the command" in "\n".join(status.lines())
    begun(path)
    assert read_status(str(tmp_path)).count("done") == 1


def test_a_unit_that_was_cut_short_by_a_kill_is_not_running_for_ever(tmp_path, job):
    path = tmp_path / "ledger" / "run.sqlite"
    begun(path).started(Order(job, RECORDINGS[1]), 1)  # and the process is gone
    begun(path)
    assert read_status(str(tmp_path)).count("running") == 0


def test_books_of_shards_are_read_as_one(tmp_path, job):
    for i in range(2):
        ledger = begun(tmp_path / "ledger" / ledger_name((i, 2)), RECORDINGS[i::2])
        label(ledger, job, RECORDINGS[i])
        ledger.close()
    status = read_status(str(tmp_path))
    assert [(row["name"], row["state"]) for row in status.recordings] == [
        ("a", "done"),
        ("b", "done"),
        ("c", "waiting"),
    ]


def test_shards_that_did_not_begin_are_told(tmp_path):
    begun(tmp_path / "ledger" / ledger_name((1, 3)))
    begun(tmp_path / "ledger" / "run.sqlite")
    status = read_status(str(tmp_path))
    assert status.missing_shards == ("0/3", "2/3")
    assert "not begun, and not counted above: 2 shards (0/3, 2/3)" in status.lines()
    for i in (0, 2):
        begun(tmp_path / "ledger" / ledger_name((i, 3)))
    assert read_status(str(tmp_path)).missing_shards == ()


def test_a_recording_in_several_books_is_as_far_as_the_one_that_knows_most(tmp_path, job):
    label(begun(tmp_path / "ledger" / "run.sqlite"), job, RECORDINGS[0])
    begun(tmp_path / "ledger" / ledger_name((0, 1)))
    assert read_status(str(tmp_path)).count("done") == 1


def test_books_that_cannot_be_written_are_told_once_and_stop_nothing(tmp_path, job, caplog):
    ledger = begun(tmp_path / "ledger" / "run.sqlite")
    ledger._books.execute("PRAGMA query_only = ON")  # as a disk that is full
    for recording in RECORDINGS:
        label(ledger, job, recording)
    ledger.close()
    assert caplog.text.count("cannot be written") == 1


def test_no_run_and_damaged_books_are_told_in_a_sentence(tmp_path):
    with pytest.raises(InputError, match="holds no run"):
        read_status(str(tmp_path))
    (tmp_path / "ledger").mkdir()
    (tmp_path / "ledger" / "run.sqlite").write_bytes(b"no database" * 100)
    with pytest.raises(InputError, match="is damaged"):
        read_status(str(tmp_path))


def test_units_are_accounted_for_one_by_one(tmp_path, job):
    ledger = begun(tmp_path / "ledger" / "run.sqlite")
    label(ledger, job, RECORDINGS[0])
    with sqlite3.connect(tmp_path / "ledger" / "run.sqlite") as books:
        assert books.execute("SELECT recording, unit, state, tries FROM units").fetchall() == [
            ("a", "start", "done", 1)
        ]
        key, started = books.execute("SELECT settings_key, started FROM run").fetchone()
    assert key == "key"
    assert time.time() - started < 60


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE recordings SET state = 'odd'",
        "UPDATE recordings SET name = NULL WHERE name = 'a'",
        "UPDATE recordings SET scans = 'x'",
        "UPDATE recordings SET seconds = 9e999",
        "UPDATE recordings SET warnings = '{'",
        "UPDATE recordings SET warnings = '[1]'",
        "UPDATE recordings SET trace = x'ff'",
        "UPDATE run SET seen = 'x'",
        "ALTER TABLE recordings RENAME COLUMN points TO others",
        # a table of rows without end
        "DROP TABLE units; CREATE VIEW units AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) "
        "SELECT x FROM c",
    ],
)
def test_books_that_hold_something_else_are_told(tmp_path, change):
    path = tmp_path / "ledger" / "run.sqlite"
    begun(path).close()
    with sqlite3.connect(path) as books:
        books.executescript(change)
    with pytest.raises(InputError, match=r"run\.sqlite is damaged"):
        read_status(str(tmp_path))


def test_names_of_recordings_give_the_terminal_no_orders(tmp_path, capsys):
    ledger = begun(tmp_path / "ledger" / "run.sqlite", [Recording("a\x1b[31m\nerror: b", "/logs/a")])
    ledger.failed(Recording("a\x1b[31m\nerror: b", "/logs/a"), "\x1b[2J", "")
    output.print("\n".join(read_status(str(tmp_path)).lines()))
    said = capsys.readouterr().out
    assert "\x1b" not in said
    assert "a\N{REPLACEMENT CHARACTER}[31m error: b" in said
