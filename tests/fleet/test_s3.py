"""From bucket to bucket, against a server that speaks S3."""

import json
import logging
import sys
import threading
import time

import pytest
from small_fleet import result_files

from automos.cli import main
from automos.fleet.label import Resources, label_fleet
from automos.fleet.local_pool import LocalPool
from automos.fleet.publishing import MARKER
from automos.fleet.sources import find_all
from automos.fleet.status import read_status

pytestmark = pytest.mark.slow


@pytest.fixture
def bucket(s3, fleet):
    """Return the server, with the fleet in its bucket."""
    s3.files.put(str(fleet.folder) + "/", "bucket/logs/", recursive=True)
    return s3


@pytest.fixture
def automos(monkeypatch, capsys, tmp_path):
    """Return a function that runs the command line and returns its exit code and what it printed."""

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["automos", *map(str, words)])
        with pytest.raises(SystemExit) as leaving:
            main()
        said = capsys.readouterr()
        return leaving.value.code or 0, said.out + said.err

    return run


def test_a_bucket_is_labelled_into_a_bucket_as_on_a_disk(bucket, fleet, automos, tmp_path):
    options = ["--out", "s3://bucket/labels", "--workers", 2, "--work", tmp_path / "work", "--cache", 0.01]
    code, said = automos("label", "s3://bucket/logs", *options)
    assert (code, "3 of 3 recordings labelled" in said) == (0, True), said
    bucket.files.get("bucket/labels/", str(tmp_path / "labels") + "/", recursive=True)
    assert fleet.differences(tmp_path / "labels") == []
    run = json.loads((tmp_path / "labels" / "log00" / "run.json").read_text())
    assert run["recording"]["source"] == "s3://bucket/logs/log00"
    assert not [path for path in bucket.files.find("bucket/labels") if "/stages/" in path]
    assert not list((tmp_path / "work" / "results").rglob("*.label"))  # nothing is left on the way
    assert bucket.secret not in "".join(path.read_text() for path in (tmp_path / "labels").rglob("*.json"))

    times = {path: info["LastModified"] for path, info in bucket.files.find("bucket/labels/log00", detail=True).items()}
    code, said = automos("label", "s3://bucket/logs", *options)
    assert (code, "(3 had been before)" in said) == (0, True)
    assert times == {
        path: info["LastModified"] for path, info in bucket.files.find("bucket/labels/log00", detail=True).items()
    }
    code, said = automos("status", "s3://bucket/labels")
    assert (code, "3 of 3 recordings labelled" in said) == (0, True)


def test_from_a_bucket_to_a_disk_and_from_a_disk_to_a_bucket(bucket, fleet, automos, tmp_path):
    work = ["--work", tmp_path / "work", "--workers", 1]
    assert automos("label", "s3://bucket/logs", "--out", tmp_path / "out", *work)[0] == 0
    assert fleet.differences(tmp_path / "out") == []
    assert "(3 had been before)" in automos("label", "s3://bucket/logs", "--out", tmp_path / "out", *work)[1]
    assert automos("label", fleet.folder / "log01", "--out", "s3://bucket/one", *work)[0] == 0
    bucket.files.get("bucket/one/", str(tmp_path / "one") + "/", recursive=True)
    assert result_files(tmp_path / "one") == fleet.expected["log01"]


def test_recordings_that_are_cut_go_through_a_bucket_just_so(bucket, fleet, automos, tmp_path):
    options = ["--out", "s3://bucket/labels", "--workers", 2, "--work", tmp_path / "work", "--chunk", 5]
    assert automos("label", "s3://bucket/logs", *options)[0] == 0
    bucket.files.get("bucket/labels/", str(tmp_path / "labels") + "/", recursive=True)
    assert fleet.differences(tmp_path / "labels") == []


def test_a_store_that_is_away_for_ten_seconds_costs_ten_seconds(s3, make_fleet, tmp_path):
    fleet, ended = make_fleet(30), []
    s3.files.put(str(fleet.folder) + "/", "bucket/logs/", recursive=True)

    def label() -> None:
        found, resources = find_all("s3://bucket/logs"), Resources(work=tmp_path / "work")
        ended.append(
            label_fleet(
                found, "s3://bucket/labels", fleet.settings, resources, executor=lambda resources: LocalPool(2, 2)
            )
        )

    run = threading.Thread(target=label)
    run.start()
    while len(s3.files.glob(f"bucket/labels/*/{MARKER}")) < 10:
        assert run.is_alive()
        time.sleep(0.2)
    s3.server.pause()
    time.sleep(10.0)
    s3.server.go_on()
    run.join()
    assert (len(ended[0].labelled), ended[0].failed) == (30, {})
    assert max(unit["seconds"] for unit in read_status("s3://bucket/labels").units) > 9.0  # it was missed
    s3.files.get("bucket/labels/", str(tmp_path / "labels") + "/", recursive=True)
    assert fleet.differences(tmp_path / "labels") == []


def test_wrong_addresses_are_told_in_a_sentence(bucket, automos, tmp_path):
    code, said = automos("label", "s3://bucket/nothing", "--out", tmp_path / "out")
    assert (code, "s3://bucket/nothing holds nothing" in said) == (2, True)
    code, said = automos("label", "s3://no-such-bucket/logs", "--out", tmp_path / "out")
    assert (code, said.startswith("error: ")) == (2, True)


def test_results_without_their_marker_are_made_again(bucket, fleet, automos, tmp_path):
    options = ["--out", "s3://bucket/labels", "--workers", 1, "--work", tmp_path / "work"]
    automos("label", "s3://bucket/logs", *options)
    bucket.files.rm(f"bucket/labels/log01/{MARKER}")
    assert "(2 had been before)" in automos("label", "s3://bucket/logs", *options)[1]
    assert read_status("s3://bucket/labels").count("done") == 3


def test_credentials_are_not_in_what_is_logged(bucket, fleet, tmp_path, caplog):
    caplog.set_level(logging.DEBUG, logger="automos")
    label_fleet(
        find_all("s3://bucket/logs")[:1],
        "s3://bucket/labels",
        fleet.settings,
        Resources(work=tmp_path / "work", workers=1),
    )
    assert bucket.secret not in caplog.text
