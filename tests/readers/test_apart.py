"""A file whose library dies of it costs a sentence, not the process that asked for it."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from street_log import street_log
from test_las import write_las

from automos.core.errors import InputError
from automos.core.parallel import map_in_order
from automos.readers import apart, open_sequence

laspy = pytest.importorskip("laspy")
pytest.importorskip("lazrs")


def deadly(path):
    """Write a LAZ file of form 3 whose packed bytes are all 0xFF, from which lazrs does not come back."""
    header = laspy.LasHeader(version="1.2", point_format=3)
    header.scales = np.full(3, 1e-3)
    las = laspy.LasData(header)
    las.x, las.y, las.z = np.random.default_rng(0).normal(0, 20, (3, 3000))
    las.write(path)
    raw = bytearray(path.read_bytes())
    start, width = int.from_bytes(raw[96:100], "little"), int.from_bytes(raw[105:107], "little")
    first, table = start + 8 + width, int.from_bytes(raw[start : start + 8], "little")
    raw[first:table] = b"\xff" * (table - first)
    path.write_bytes(raw)


@pytest.fixture
def log(tmp_path):
    """Return a folder of three sweeps, of which the second is deadly."""
    for name, scan in zip("ac", street_log().scans, strict=False):
        write_las(tmp_path / "log" / f"{name}.laz", scan)
    deadly(tmp_path / "log" / "b.laz")
    return tmp_path / "log"


def n_points(of):
    folder, index = of
    try:
        return len(open_sequence(folder)[index])
    except InputError as error:
        return str(error)


def test_a_file_that_its_library_dies_of_is_told_and_the_next_is_read(log):
    sequence = open_sequence(log)
    assert len(sequence[0]) > 0
    for _ in range(2):
        with pytest.raises(InputError, match=r"b\.laz ends the library that reads it"):
            sequence[1]
    assert len(sequence[2]) > 0


@pytest.mark.slow
def test_it_is_told_in_threads_and_in_worker_processes_too(log):
    items = [(log, k % 3) for k in range(6)]
    for threads in (True, False):
        found = list(map_in_order(n_points, items, 2, threads=threads))
        assert [isinstance(each, int) for each in found] == [True, False, True] * 2
        assert "b.laz ends the library" in found[1]


def test_a_script_that_guards_nothing_is_not_run_again(log, tmp_path):
    (tmp_path / "script.py").write_text(
        f"print('begun')\nimport automos\nprint(len(automos.open_sequence({str(log)!r})[0]))\n"
    )
    run = subprocess.run(
        [sys.executable, tmp_path / "script.py"], capture_output=True, text=True, timeout=60, check=True
    )
    assert [run.stdout.split()[0], len(run.stdout.split()), run.stderr] == ["begun", 2, ""]


def test_a_process_is_kept_for_the_next_file_and_its_loss_while_it_waits_is_nobodys_fault(log):
    sequence = open_sequence(log)
    whole = sequence[0]
    *others, kept = apart._idle[os.getpid()]
    sequence[2]
    assert apart._idle[os.getpid()] == [*others, kept]
    kept._process.kill()
    np.testing.assert_array_equal(sequence[0].points, whole.points)


def test_an_interruption_leaves_no_half_answer_for_the_next_file(log, monkeypatch):
    sequence = open_sequence(log)
    whole = sequence[0]

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(apart._Reader, "_array", interrupted)
        with pytest.raises(KeyboardInterrupt):
            sequence[2]
    np.testing.assert_array_equal(sequence[0].points, whole.points)


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="signals are sent to groups of processes elsewhere")
@pytest.mark.parametrize("how", ["SIGINT", "SIGKILL"])
def test_it_ends_when_its_caller_is_ended_and_says_nothing(log, how):
    code = (
        f"import sys, time, automos\nfrom automos.readers import apart\nautomos.open_sequence({str(log)!r})[0]\n"
        "((reader,),) = apart._idle.values()\n"
        "try:\n    print(reader._process.pid, flush=True)\n    time.sleep(60)\n"
        "except KeyboardInterrupt:\n    sys.exit(3)"
    )
    caller = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True, text=True
    )
    reader = int(caller.stdout.readline())
    to = os.killpg if how == "SIGINT" else os.kill  # a terminal sends Ctrl-C to all of a group
    to(caller.pid, getattr(signal, how))
    assert caller.communicate(timeout=30) == ("", "")
    end = time.monotonic() + 10.0
    while is_alive(reader) and time.monotonic() < end:
        time.sleep(0.05)
    assert not is_alive(reader)


def is_alive(process):
    try:
        os.kill(process, 0)
        with open(f"/proc/{process}/stat") as file:  # Linux alone has it; it may be over, and nobody has asked how
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except ProcessLookupError:
        return False
    except FileNotFoundError:
        return not os.path.isdir("/proc/self")


def test_where_no_process_can_be_started_that_is_told_with_the_file(log, monkeypatch):
    monkeypatch.setattr(apart, "_idle", {})
    places = ["/no/python", *(place for place in ("/bin/false", "/usr/bin/false") if os.path.exists(place))]
    for place in places:
        monkeypatch.setattr(sys, "executable", place)
        with pytest.raises(InputError, match=r"a\.laz is read by a process of its own, which cannot be started \("):
            open_sequence(log)[0]


def test_a_table_that_its_library_dies_of_is_told(tmp_path):
    pyarrow, feather = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.feather")
    scans = tmp_path / "log" / "sensors" / "lidar"
    scans.mkdir(parents=True)
    lists = pyarrow.array([[1.0, 2.0]] * 400)
    path = scans / "1.feather"
    feather.write_feather(pyarrow.table({"x": lists}), path, compression="uncompressed")
    raw, offsets = path.read_bytes(), np.arange(100, 801, 2, dtype=np.int32).tobytes()
    assert raw.count(offsets) == 1
    path.write_bytes(raw.replace(offsets, b"\xff" * len(offsets)))
    with pytest.raises(InputError, match=r"1\.feather ends the library that reads it"):
        open_sequence(tmp_path / "log")[0]
