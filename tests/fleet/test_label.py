"""Many recordings, really labelled: whatever the executor, the cuts and the interruptions, the bytes are the same."""

import json
import os
import shutil
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_fleet import N_SCANS, result_files, write_recording

from automos.core.errors import InputError
from automos.core.geometry import make_transform
from automos.core.pose_writers import write_kitti
from automos.fleet.fleet import Outcome
from automos.fleet.label import Resources, closing_lines, has_one_process_enough, label_fleet, make_executor
from automos.fleet.local_pool import InProcess, LocalPool
from automos.fleet.orders import Recording
from automos.fleet.publishing import MARKER
from automos.fleet.sources import find_all
from automos.fleet.status import read_status
from automos.labeling import label_recording
from automos.readers import open_sequence
from automos.settings import load_settings


@pytest.fixture
def label(fleet, tmp_path):
    """Return a function that labels the fleet into tmp_path/out."""

    def label(
        executor=lambda resources: InProcess(), folder=fleet.folder, settings=fleet.settings, **resources
    ) -> Outcome:
        resources = Resources(work=tmp_path / "work", **resources)
        return label_fleet(find_all(str(folder)), str(tmp_path / "out"), settings, resources, executor=executor)

    return label


@pytest.fixture(scope="module")
def _labelled(make_fleet, tmp_path_factory) -> tuple[Outcome, Path]:
    fleet, root = make_fleet(2), tmp_path_factory.mktemp("labelled")
    resources, found = Resources(work=root / "work"), find_all(str(fleet.folder))
    outcome = label_fleet(found, str(root / "out"), fleet.settings, resources, executor=lambda resources: InProcess())
    return outcome, root / "out"


@pytest.fixture
def labelled(_labelled, tmp_path) -> Outcome:
    """Return what came of labelling the fleet; the results are in tmp_path/out."""
    shutil.copytree(_labelled[1], tmp_path / "out")
    return _labelled[0]


@pytest.mark.parametrize("value", [float("inf"), float("nan"), -1.0, 1e308])
@pytest.mark.parametrize("name", ["memory_gb", "cache_gb", "workers"])
def test_resources_that_no_machine_has_are_told_by_their_option(name, value):
    with pytest.raises(InputError, match=r"^(--\w+ is .* GB: give|workers are 0)"):
        Resources(**{name: value if name != "workers" else 10**20})


def test_a_fleet_is_labelled_as_each_recording_by_itself(fleet, labelled, tmp_path):
    assert labelled.labelled == fleet.names
    assert fleet.differences(tmp_path / "out") == []
    marker = json.loads((tmp_path / "out" / "log00" / MARKER).read_text())
    assert set(marker["files"]) > set(fleet.expected["log00"])
    assert "settings.yaml" in marker["files"]
    assert not any(path.startswith("stages") for path in marker["files"])


def test_recordings_that_are_cut_have_the_same_labels(fleet, label, tmp_path):
    assert label(chunk=5).labelled == fleet.names
    assert fleet.differences(tmp_path / "out") == []
    units = {unit["unit"] for unit in read_status(str(tmp_path / "out")).units}
    assert {"evidence 0:5", "evidence 10:12", "tracks", "labels 5:10", "results"} <= units


def test_methods_that_need_the_whole_recording_are_not_cut(fleet, label, tmp_path):
    settings = load_settings("default", None, {"candidates.method": "octomap"})
    shutil.copytree(fleet.folder / "log00", tmp_path / "logs" / "log00")
    assert label(chunk=5, settings=settings, folder=tmp_path / "logs").labelled == ["log00"]
    assert {unit["unit"] for unit in read_status(str(tmp_path / "out")).units} == {"start"}


def test_what_is_there_already_is_not_done_again(fleet, label, labelled, tmp_path):
    times = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("predictions/*")}
    outcome = label()
    assert (outcome.labelled, outcome.had_been) == ([], fleet.names)
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("predictions/*")} == times
    assert "2 of 2 recordings labelled (2 had been before)" in closing_lines(outcome, "out")[0]


def test_the_closing_lines_count_what_has_warnings_and_tell_where_to_read_them(fleet, label, tmp_path):
    folder = shutil.copytree(fleet.folder, tmp_path / "logs")
    for scan in sorted((folder / "log01").glob("*.bin"))[3:]:
        scan.unlink()
    known = load_settings("default", None, {"recording.rate": 10.0})  # else all would be warned of
    first, again = label(folder=folder, settings=known), label(folder=folder, settings=known)
    assert first.warned == again.warned == ["log01"]
    assert closing_lines(first, "out")[1:] == ["1 of them with warnings; read them: automos status out"]


def test_a_recording_that_changed_or_whose_marker_is_gone_is_done_again(fleet, label, labelled, tmp_path):
    folder = shutil.copytree(fleet.folder, tmp_path / "logs")
    os.utime(folder / "log01" / "000003.bin")
    assert label(folder=folder).labelled == ["log01"]
    (tmp_path / "out" / "log00" / MARKER).unlink()
    assert label(folder=folder).labelled == ["log00"]
    assert fleet.differences(tmp_path / "out") == []


def test_labels_that_somebody_made_over_with_other_settings_are_made_again(fleet, label, labelled, tmp_path):
    other = load_settings("default", None, {"labels.unsure": 0.99})
    label_recording(open_sequence(fleet.folder / "log00"), tmp_path / "out" / "log00", other, workers=1)
    assert fleet.differences(tmp_path / "out") == ["log00"]
    assert label().labelled == ["log00"]
    assert fleet.differences(tmp_path / "out") == []


def test_labels_made_with_given_poses_are_made_again_without_where_that_is_asked_for(fleet, tmp_path):
    name = fleet.names[0]
    recording = Recording(name, str(fleet.folder / name))
    moved = tmp_path / "poses.txt"
    write_kitti(moved, np.stack([make_transform(t=[3.0 * i, 0.0, 0.0]) for i in range(N_SCANS)]))

    def label(pose_file, overwrite=False):
        resources = Resources(work=tmp_path / "work", chunk=4)
        files = (pose_file, None, overwrite)
        return label_fleet(
            [recording], str(tmp_path / "out"), fleet.settings, resources, None, files, None, lambda _: InProcess()
        )

    assert label(moved).labelled == [name]
    assert result_files(tmp_path / "out" / name) != fleet.expected[name]
    made = result_files(tmp_path / "out" / name)
    assert "holds results with other poses, which would be replaced: add --overwrite" in label(None).failed[name]
    assert result_files(tmp_path / "out" / name) == made
    assert label(None, overwrite=True).labelled == [name]
    assert result_files(tmp_path / "out" / name) == fleet.expected[name]
    assert label(None).had_been == [name]


def test_results_of_other_settings_are_not_mixed_with_these(fleet, label, labelled, tmp_path):
    with pytest.raises(InputError, match="holds a run with other settings"):
        label(settings=load_settings("default", None, {"labels.unsure": 0.5}))
    assert fleet.differences(tmp_path / "out") == []


def test_results_of_several_recordings_are_not_put_among_those_of_one(fleet, label, tmp_path):
    label_recording(open_sequence(fleet.folder / "log00"), tmp_path / "out", fleet.settings, workers=1)
    with pytest.raises(InputError, match="out holds the results of one recording"):
        label()
    assert not (tmp_path / "out" / "log00").exists()


def test_recordings_are_not_labelled_in_their_own_folders(fleet, tmp_path):
    logs = shutil.copytree(fleet.folder, tmp_path / "logs")
    (logs / "log01" / "poses.txt").write_text("theirs")
    resources = Resources(work=tmp_path / "work")
    outcome = label_fleet(
        find_all(str(logs)), str(logs), fleet.settings, resources, executor=lambda resources: InProcess()
    )
    assert outcome.labelled == []
    for name in fleet.names:
        assert outcome.failed[name].endswith("automos did not make that folder: choose another --out")
    assert (logs / "log01" / "poses.txt").read_text() == "theirs"
    assert not (logs / "log01" / "predictions").exists()


@pytest.mark.parametrize("target", ["s3://bucket/logs", "s3://bucket/logs/a", "s3://bucket/logs/a/labels"])
def test_labels_do_not_become_part_of_a_recording_in_a_store(fleet, tmp_path, target):
    found = [Recording("a", "s3://bucket/logs/a", folder="a" if target.endswith("logs") else "")]
    with pytest.raises(InputError, match="lies in the recording s3://bucket/logs/a, of which labels must not be"):
        label_fleet(found, target, fleet.settings, Resources(work=tmp_path))


def test_a_scan_cut_short_is_told_and_the_other_recordings_are_labelled(fleet, label, tmp_path):
    folder = shutil.copytree(fleet.folder, tmp_path / "logs")
    scan = folder / "log01" / "000006.bin"
    scan.write_bytes(scan.read_bytes()[:-7])
    outcome = label(folder=folder)
    assert list(outcome.failed) == ["log01"]
    assert "000006.bin" in outcome.failed["log01"]
    assert fleet.differences(tmp_path / "out") == ["log01"]
    assert not (tmp_path / "out" / "log01" / MARKER).exists()
    assert read_status(str(tmp_path / "out")).failures == [("log01", outcome.failed["log01"])]
    shutil.copy(fleet.folder / "log01" / "000006.bin", scan)
    assert label(folder=folder).labelled == ["log01"]
    assert fleet.differences(tmp_path / "out") == []


def test_a_bug_in_one_recording_stops_no_other_and_its_place_is_kept(fleet, label, tmp_path, monkeypatch):
    def broken(sequence, *rest, **named):
        if sequence.name == "log01":
            raise ZeroDivisionError("division by zero")
        return label_recording(sequence, *rest, **named)

    monkeypatch.setattr("automos.fleet.units.label_recording", broken)
    outcome = label()
    assert outcome.failed == {
        "log01": "ZeroDivisionError: division by zero; this is a bug of automos, its place is in the ledger"
    }
    row = next(row for row in read_status(str(tmp_path / "out")).recordings if row["name"] == "log01")
    assert "in broken" in row["trace"]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals that a process is killed by")
def test_processes_that_are_killed_at_random_lose_nothing(fleet, label, tmp_path):
    pool = LocalPool(2, 2)
    is_over = threading.Event()
    killed = []

    def kill() -> None:
        while len(killed) < 2 and not is_over.wait(1.0):
            for pid in pool.pids[:1]:
                os.kill(pid, 9)
                killed.append(pid)

    killer = threading.Thread(target=kill)
    killer.start()
    outcome = label(executor=lambda resources: pool, chunk=5)
    is_over.set()
    killer.join()
    assert killed
    assert sorted([*outcome.labelled, *outcome.failed]) == fleet.names
    assert fleet.differences(tmp_path / "out") == sorted(outcome.failed)
    assert all("SIGKILL" in reason for reason in outcome.failed.values())


def test_a_worker_that_is_killed_idle_is_replaced(fleet, label, labelled):
    with LocalPool(1, 1) as pool:
        label(executor=lambda resources: _Kept(pool))
        os.kill(pool._idle[0].pid, 9)
        pool._idle[0].wait()
        assert len(label(executor=lambda resources: _Kept(pool)).had_been) == len(fleet.names)


class _Kept:
    """An executor that its user closes."""

    def __init__(self, inner):
        self._inner = inner

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def __enter__(self):
        return self._inner

    def __exit__(self, *error):
        return None


@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")
def test_when_the_parent_is_gone_its_workers_are_too(fleet, tmp_path):
    import subprocess
    import sys

    code = (
        "import sys; from automos.fleet.local_pool import LocalPool; from automos.fleet.orders import *\n"
        "from automos.settings import load_settings; from pathlib import Path; import time\n"
        "pool = LocalPool(1, 1)\n"
        f"job = Job(load_settings('default'), {str(tmp_path / 'out')!r}, Path({str(tmp_path)!r}))\n"
        f"pool.submit(Order(job, Recording('a', {str(fleet.folder / 'log00')!r})))\n"
        "print(*pool.pids, flush=True); time.sleep(60)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    worker = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 20
    while _is_alive(worker):
        assert time.monotonic() < deadline
        time.sleep(0.1)


def _is_alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def test_of_a_disk_that_fills_up_nothing_half_written_is_taken_for_a_result(fleet, label, tmp_path, monkeypatch):
    from automos.core import atomic

    room = [30]
    replace_ = os.replace

    def full(source, target):
        room[0] -= 1
        if room[0] < 0:
            raise OSError(28, "No space left on device")
        return replace_(source, target)

    monkeypatch.setattr(atomic.os, "replace", full)
    outcome = label()
    assert not outcome.labelled
    assert all("No space left on device" in reason for reason in outcome.failed.values())
    assert not list((tmp_path / "out").rglob(MARKER))
    room[0] = 10**6
    assert label().labelled == fleet.names
    assert fleet.differences(tmp_path / "out") == []


@pytest.mark.parametrize(
    ("resources", "kind", "slots"),
    [
        (Resources(workers=1), InProcess, 1),
        (Resources(workers=3, memory_gb=1e6), LocalPool, 3),
        (Resources(workers=0, memory_gb=1e6), InProcess, 1),  # no machine has that much: one worker at a time
    ],
)
def test_workers_are_as_many_as_asked_for_or_as_fit_into_memory(resources, kind, slots):
    with make_executor(resources) as executor:
        assert type(executor) is kind
        assert executor.slots == slots


def test_one_short_recording_needs_no_fleet(fleet):
    found = find_all(str(fleet.folder / "log00"))
    assert has_one_process_enough(found, "out", Resources(workers=2))
    assert not has_one_process_enough(found, "out", Resources(workers=2, chunk=5))
    assert has_one_process_enough(found, "out", Resources(workers=1, chunk=5))
    assert not has_one_process_enough(found, "s3://bucket/out", Resources())
    assert not has_one_process_enough([*found, replace(found[0], name="b")], "out", Resources())


def test_what_a_recording_is_warned_of_stands_in_the_status_of_the_fleet(label, tmp_path):
    write_recording(tmp_path / "short" / "two_scans", seed=0, n_scans=2)
    label(folder=tmp_path / "short")
    told = "\n".join(read_status(str(tmp_path / "out")).lines())
    assert "warning: two_scans: 2 scans over 0.1 s are too few to decide what moves" in told


def test_every_recording_of_a_fleet_is_the_sensor_s_own(tmp_path):
    # Seen from seven metres below the ground their points are spread a little better.
    for seed in (15, 16, 17):
        assert len(open_sequence(write_recording(tmp_path / f"log{seed}", seed=seed))) == N_SCANS
