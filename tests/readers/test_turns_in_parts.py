"""Drivers that publish parts of a turn: they are joined to whole ones, and what is no part is left alone."""

import numpy as np
import pytest
from bags import cloud, write_bag
from sweeps import pose, sweep

from automos.readers import open_sequence
from automos.readers.turns import joined, parts_in_a_turn, places_in_time

N_TURNS = 6


@pytest.fixture(scope="module")
def drive():
    """Return the points of a drive one after the other, `time` in seconds since its begin."""
    turns = [sweep(pose(x=0.3 * i), seed=i, n_columns=360) for i in range(N_TURNS)]
    columns = {name: np.concatenate([turn[name] for turn in turns]) for name in turns[0]}
    n = [len(turn["x"]) for turn in turns]
    columns["time"] = columns["time"].astype(float) + 0.1 * np.repeat(np.arange(N_TURNS), n)
    order = np.argsort(columns["time"], kind="stable")
    return {name: column[order] for name, column in columns.items()}


def parts_of(drive, parts, begin=0.0):
    """Return the rows of each part of the drive, of which `parts` are a turn; the first ends `begin` of one early."""
    number = np.floor(drive["time"] * 10.0 * parts + begin + 1e-6).astype(int)
    return np.split(np.arange(len(number)), np.flatnonzero(np.diff(number)) + 1)


TIMES = {
    "since the part began": lambda t: {"time": (t - t[0]).astype("f4")},
    "nanoseconds since the part began": lambda t: {"t": np.round(1e9 * (t - t[0])).astype("u4")},
    "until the part ends": lambda t: {"time": (t - t[-1]).astype("f4")},
    "since 1970": lambda t: {"timestamp": 1.5e9 + t},
    "since the turn began": lambda t: {"time": np.mod(t + 1e-7, 0.1)},
    "none": lambda t: {},
}


def write(path, drive, rows_of_parts, times, jitter=0.0, end=False):
    messages, rng = [], np.random.default_rng(0)
    for rows in rows_of_parts:
        t = drive["time"][rows]
        columns = {name: drive[name][rows] for name in ("x", "y", "z", "intensity")} | TIMES[times](t)
        stamp = 1.5e9 + t[-1 if end else 0] + jitter * rng.uniform()
        messages.append((round(1e9 * stamp), stamp, cloud(columns)))
    return write_bag(path, {"/points": messages})


@pytest.mark.parametrize("times", TIMES)
@pytest.mark.parametrize(("parts", "begin"), [(10, 0.0), (2, 0.0), (4, 0.5), (36, 0.0)])
def test_parts_of_a_turn_are_joined_to_whole_ones(tmp_path, drive, parts, begin, times):
    rows = parts_of(drive, parts, begin)
    sequence = open_sequence(write(tmp_path / "log.mcap", drive, rows, times, end=parts == 36))
    assert len(sequence) == N_TURNS  # half a part at the begin goes with the first
    assert any(f"holds a part of a turn; {parts} of them are joined" in words for words in sequence.warnings)
    np.testing.assert_allclose(np.diff(sequence.stamps), 0.1, atol=0.1 / parts)
    scans = list(sequence)
    np.testing.assert_array_equal(np.concatenate([scan.points[:, 0] for scan in scans]), drive["x"])
    np.testing.assert_array_equal(np.concatenate([scan.intensity for scan in scans]), drive["intensity"])
    if not begin or times in (
        "since the part began",
        "since 1970",
    ):  # others run backwards in half a part, or to its end
        if times == "none":
            return
        starts = np.cumsum([0, *map(len, scans)])
        for scan, first, last in zip(scans, starts[:-1], starts[1:], strict=True):
            true = drive["time"][first:last]
            np.testing.assert_allclose(scan.time, true - true[0], atol=2e-4)


def test_jitter_a_lost_part_and_an_empty_one_leave_the_turns_whole(tmp_path, drive):
    rows = parts_of(drive, 8)
    del rows[19]
    path = write(tmp_path / "log.bag", drive, rows, "since the part began", jitter=0.003)
    sequence = open_sequence(path)
    assert len(sequence) == N_TURNS
    lost = parts_of(drive, 8)[19]
    assert [len(scan) for scan in sequence] == [
        sum(map(len, parts_of(drive, 8)[8 * k : 8 * k + 8])) - (k == 2) * len(lost) for k in range(N_TURNS)
    ]


def test_a_turn_of_parts_that_do_not_count_up_to_one_is_as_even_as_may_be(tmp_path, drive):
    sequence = open_sequence(write(tmp_path / "log.bag", drive, parts_of(drive, 3.5), "since 1970"))
    share = np.array([len(scan) for scan in sequence]) / (len(drive["x"]) / N_TURNS)
    assert ((share > 0.8) & (share < 1.2)).all()
    assert all(0.08 < np.ptp(scan.time) < 0.12 for scan in sequence)


def looking(drive, width, turn, n=30):
    """Return clouds of a sensor that sees `width` degrees and turns by `turn` from one to the next."""
    xyz = np.column_stack([drive[axis] for axis in "xyz"])[::N_TURNS]
    azimuth = np.degrees(np.arctan2(xyz[:, 1], xyz[:, 0]))
    return [xyz[np.abs((azimuth - turn * k + 180.0) % 360.0 - 180.0) < 0.5 * width] for k in range(n)]


@pytest.mark.parametrize(
    ("width", "turn", "parts"),
    [
        (360, 36, 1), (290, 0, 1), (180, 0, 1), (90, 0, 1), (40, 0, 1), (90, 20, 1), (40, 5, 1),
        (36, 36, 10), (36, -36, 10), (40, 36, 10), (90, 90, 4), (90, -90, 4), (180, 180, 2), (30, 36, 10),
    ],
)  # fmt: skip
def test_a_sensor_that_looks_to_one_side_or_all_round_is_left_alone(drive, width, turn, parts):
    clouds = looking(drive, width, turn)
    assert parts_in_a_turn(lambda k: clouds[k], np.arange(len(clouds))) == pytest.approx(parts, abs=0.1)


def test_few_clouds_are_read_where_they_are_no_parts(drive):
    for width, most in ((360, 1), (90, 3)):
        clouds, read = looking(drive, width, 0), []
        parts_in_a_turn(lambda k, clouds=clouds, read=read: read.append(k) or clouds[k], np.arange(len(clouds)))
        assert len(read) == most


def test_less_than_a_turn_is_left_as_it_is(drive):
    clouds = looking(drive, 36, 36, n=6)
    assert parts_in_a_turn(lambda k: clouds[k], np.arange(6)) == 1


def test_places_count_what_is_missing():
    np.testing.assert_array_equal(places_in_time(np.array([0.0, 0.1, 0.21, 0.5, 0.6]), 5), [0, 1, 2, 5, 6])
    np.testing.assert_array_equal(places_in_time(None, 3), [0, 1, 2])


def test_a_column_that_a_part_lacks_is_left_out_and_a_part_without_points_has_none():
    ones = np.ones(2, np.float32)
    whole = joined([{"x": ones, "ring": ones}, {"x": ones[:0]}, {"x": ones}], None, None)
    assert {name: len(column) for name, column in whole.items()} == {"x": 4}


def test_a_folder_with_a_file_for_each_part_is_told(tmp_path, drive):
    for k, rows in enumerate(parts_of(drive, 10)):
        columns = [drive[name][rows] for name in ("x", "y", "z", "intensity")]
        np.column_stack(columns).astype("<f4").tofile(tmp_path / f"{k:06d}.bin")
    (said,) = (words for words in open_sequence(tmp_path).warnings if "part of a turn" in words)
    assert "a file holds a part of a turn and is labelled as a scan of its own" in said
