"""Times in a table beside the scans: one a line, with a line's number, a file's name or anything else beside them."""

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.readers.scan_times import NAMES, read_times

STAMPS = 1_500_000_000.0 + 0.1 * np.arange(12)


def names(n):
    return [f"{k:06d}" for k in range(n)]


WRITTEN = {
    "milliseconds": [f"{1e3 * t:.0f}" for t in STAMPS],
    "microseconds": [f"{1e6 * t:.0f}" for t in STAMPS],
    "nanoseconds": [f"{round(1e9 * t)}" for t in STAMPS],
    "nanoseconds since it was switched on": [f"{round(1e9 * (t - STAMPS[0]))}" for t in STAMPS],
    "dates": [f"2017-07-14 02:40:0{k // 10}.{k % 10}00000000" for k in range(12)],
    "seconds": [f"{t:.3f}" for t in STAMPS],
    "few seconds": [f"{t - STAMPS[0]:.1e}" for t in STAMPS],
}


@pytest.mark.parametrize("unit", WRITTEN)
def test_times_are_seconds_of_whatever_is_counted(tmp_path, unit):
    (tmp_path / "times.txt").write_text("\n".join(WRITTEN[unit]))
    found = read_times(tmp_path / "times.txt", names(12))
    np.testing.assert_allclose(found - found[0], STAMPS - STAMPS[0], atol=1e-5)


def test_whole_milliseconds_of_twenty_scans_a_second_are_no_seconds(tmp_path):
    (tmp_path / "times.txt").write_text("0\n50\n100\n151\n")
    np.testing.assert_allclose(read_times(tmp_path / "times.txt", names(4)), [0.0, 0.05, 0.1, 0.151])


def test_scans_ten_seconds_apart_are_not_taken_for_milliseconds(tmp_path):
    (tmp_path / "times.txt").write_text("0\n10\n20\n30\n")
    np.testing.assert_array_equal(read_times(tmp_path / "times.txt", names(4)), [0.0, 10.0, 20.0, 30.0])


TABLES = {
    "a header": ["timestamp", *(f"{t:.3f}" for t in STAMPS)],
    "a remark": ["# time [s]", "", *(f"{t:.3f}" for t in STAMPS)],
    "numbers of lines": [f"{k} {t:.3f}" for k, t in enumerate(STAMPS)],
    "numbers that begin with one": [f"{k + 1},{t:.3f}" for k, t in enumerate(STAMPS)],
    "even nanoseconds first": [f"{10**9 + 10**8 * k};{k}" for k in range(12)],
    "names, with a header": [
        "filename,Timestamp (ns)", *(f"lidar/{k:06d}.bin,{round(1e9 * t)}" for k, t in enumerate(STAMPS))],
    "names, without": [f"{k:06d}.pcd\t{t:.3f}" for k, t in enumerate(STAMPS)],
    "names in another order": ["scan,time", *(f"{k:06d},{STAMPS[k]:.3f}" for k in (3, 2, 1, 0, *range(11, 3, -1)))],
    "more than there are": [f"{k},{1_499_999_999.8 + 0.1 * k:.3f}" for k in range(-3, 20)],
    "seconds and nanoseconds": [
        "seq,header.stamp.secs,header.stamp.nsecs",
        *(f"{k},{15 * 10**8 + k // 10},{10**8 * (k % 10)}" for k in range(12))],
    "commas in decimals": ["frame;time", *(f"{k};{t:.3f}".replace(".", ",") for k, t in enumerate(STAMPS))],
    "dates": ["frame,time", *(f"{k},2017-07-14 02:40:0{k // 10}.{k % 10}" for k in range(12))],
    "counts of points between": ["frame,points,t", *(f"{k},{9000 + 7 * k * k},{t:.3f}" for k, t in enumerate(STAMPS))],
}  # fmt: skip


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("name", ["times.txt", "timestamps.csv"])
def test_times_are_found_among_what_stands_beside_them(tmp_path, table, name):
    (tmp_path / name).write_text("\n".join(TABLES[table]))
    found = read_times(tmp_path / name, names(12))
    np.testing.assert_allclose(np.diff(found), 0.1, atol=1e-4)
    if table == "more than there are":
        np.testing.assert_allclose(found - 0.2, STAMPS - 0.4, atol=1e-3)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("suffix", [".bin", ".csv"])
@pytest.mark.parametrize("is_kitti", [False, True])
def test_a_table_beside_scans_is_none_of_them_and_gives_their_times(tmp_path, name, suffix, is_kitti):
    place = tmp_path / "velodyne" if is_kitti else tmp_path
    place.mkdir(exist_ok=True)
    for k in range(12):
        cloud = np.random.default_rng(k).normal(0.0, 9.0, (300, 4)).astype("<f4")
        if suffix == ".bin":
            cloud.tofile(place / f"{k:06d}.bin")
        else:
            np.savetxt(place / f"{k:06d}.csv", cloud, header="x y z intensity", comments="")
    (tmp_path / name).write_text("\n".join(f"{k},{t:.3f}" for k, t in enumerate(STAMPS)))
    sequence = open_sequence(tmp_path)
    assert len(sequence) == 12
    assert sequence.about["times"] == name
    np.testing.assert_allclose(sequence.stamps, STAMPS, atol=1e-3)


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (["one", "two", "three"], "must hold one time in seconds a line, or a date: it holds 'two'"),
        (["5 7 1", "3 9 8", "4 1 2"], "it holds 'several columns'"),
        (["1 2", "3"], "'3' has another number of columns than the lines before"),
        (["0.1", "0.2"], "holds 2 times for 3 scans"),
        (["0.1", "nan", "0.2"], "line 2: the time is not a number of seconds"),
        ([], "holds"),
    ],
)
def test_what_is_no_table_of_times_is_told(tmp_path, lines, told):
    (tmp_path / "times.txt").write_text("\n".join(lines))
    with pytest.raises(InputError, match=told):
        read_times(tmp_path / "times.txt", names(3))
