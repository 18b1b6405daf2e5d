"""What a class of the caller's gives is used where it fits, and told by its property where it does not."""

import pickle
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import automos
from automos.core.array_sequence import ArraySequence
from automos.core.errors import InputError
from automos.core.own_sequence import OwnSequence, as_sequence
from automos.core.scan import Scan, Sequence

POINTS = np.random.default_rng(1).uniform(-20.0, 20.0, (5, 300, 3)).astype(np.float32)


class Mine(Sequence):
    """Five scans, as somebody would write it."""

    name = "mine"

    def __len__(self):
        return len(POINTS)

    def __getitem__(self, index):
        return Scan(POINTS[index])


def sequence_with(**members):
    return type("Mine", (Mine,), members)()


def gives(value):
    return property(lambda self: value)


@pytest.mark.parametrize("given", [POINTS[0], (POINTS[0], None), [1, 2], None, "scan"], ids=lambda x: type(x).__name__)
def test_a_scan_that_is_none_is_told_with_what_to_return(given):
    with pytest.raises(InputError, match=r"^Mine\.__getitem__ must give an automos\.Scan \(as scan 0 it gives a \w+"):
        automos.label(sequence_with(__getitem__=lambda self, index: given), workers=1)


@pytest.mark.parametrize(
    ("member", "value", "message"),
    [
        ("__len__", lambda self: -1, r"__len__ must give the number of scans \(.*>= 0\)"),
        ("__len__", lambda self: "5", r"__len__ must give the number of scans \(.*integer\)"),
        ("__len__", Sequence.__len__, r"__len__ must give the number of scans \(it is not there\)"),
        ("__len__", lambda self: 7, r"__getitem__ must give each of its 7 scans \(scan \d ends in IndexError"),
        ("__getitem__", Sequence.__getitem__, r"__getitem__ must give each of its 5 scans"),
        ("__getitem__", lambda self, index: next(iter(())), r"scan 0 ends in StopIteration"),
        ("name", None, "name must give a text, not None"),
        ("source", 5, r"source must give a pathlib\.Path or None, not 5"),
        ("stamps", gives(np.arange(4.0)), r"stamps must be \(5,\), got shape \(4,\)"),
        ("stamps", gives([0.0, 0.1, np.nan, 0.3, 0.4]), "mine has an invalid stamp of nan s"),
        ("stamps", lambda self: np.arange(5.0), "stamps must be real numbers"),
        ("repeats", gives([False, True, False]), r"repeats must be \(5,\), got shape \(3,\)"),
        ("repeats", gives("no"), "repeats must be real numbers"),
        ("is_compensated", gives("yes"), "is_compensated must give a bool or None, not 'yes'"),
        ("warnings", gives("careful"), "warnings must give a list of sentences, not 'careful'"),
        ("fingerprint", gives("abc"), r"fingerprint\(\) must give a text"),
        ("fingerprint", lambda self: b"abc", r"fingerprint\(\) must give a text, not b'abc'"),
        ("names", gives(["a"] * 4), "the names of 5 scans are"),
    ],
)
def test_what_does_not_fit_is_told_by_its_name(member, value, message):
    with pytest.raises(InputError, match=message) as error:
        automos.label(sequence_with(**{member: value}), workers=1)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("poses", [np.zeros((3, 4, 4)), np.zeros((5, 3, 4)), "poses.txt"], ids=["few", "flat", "text"])
def test_poses_that_came_with_it_and_do_not_fit_are_a_warning_since_labels_need_none(poses):
    result = automos.label(sequence_with(reference_poses=gives(poses)), workers=1)
    assert any("Mine.reference_poses must be" in warning for warning in result.warnings)


def test_lists_do_where_arrays_are_meant():
    mine = sequence_with(stamps=gives([0, 1, 2, 3, 4]), repeats=gives([0, 0, 0, 0, 0]), source="/logs/mine")
    result = automos.label(mine, workers=1)
    assert [len(result.labels(i)) for i in range(len(result))] == [300] * 5
    assert result.trajectory.stamps.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_sequences_of_ours_are_not_looked_at_twice():
    assert isinstance(as_sequence(Mine()), OwnSequence)
    ours = ArraySequence([POINTS[0]])
    assert as_sequence(ours) is ours
    assert as_sequence(as_sequence(Mine())).names == Mine().names


class OneFile(Mine):
    """Five scans in one open file, whose position all threads share."""

    place = 0

    def __getitem__(self, index):
        self.place = index
        time.sleep(0.002)
        return Scan(POINTS[self.place])


@pytest.mark.parametrize("carried", [lambda x: x, lambda x: pickle.loads(pickle.dumps(x))], ids=["here", "elsewhere"])
def test_scans_are_read_one_at_a_time(carried):
    sequence, asked = carried(as_sequence(OneFile())), list(range(5)) * 4
    with ThreadPoolExecutor(5) as pool:
        for i, scan in zip(asked, pool.map(sequence.__getitem__, asked), strict=True):
            np.testing.assert_array_equal(scan.points, POINTS[i])


def test_scans_of_other_lidars_are_refused():
    def given(self, index):
        mounts, sensor = np.tile(np.eye(4), (2, 1, 1)), np.zeros(len(POINTS[index]), np.uint8)
        return Scan(POINTS[index]) if index < 3 else Scan(POINTS[index], sensor=sensor, T_scan_sensor=mounts)

    with pytest.raises(InputError, match=r"must give scans of the same LiDARs \(scan \d is of 2"):
        automos.label(sequence_with(__getitem__=given), workers=1)
