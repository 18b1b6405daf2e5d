import numpy as np
import pytest

from automos.core.scan import Scan
from automos.online.intake import Intake, Kind


def taken(stamps, **about):
    """Return what becomes of scans at `stamps`, each of other points."""
    intake = Intake(**about)
    return [intake.take(Scan(np.full((5, 3), 1.0 + i), stamp=stamp)) for i, stamp in enumerate(stamps)]


def kinds(stamps, **about):
    return [one.kind for one in taken(stamps, **about)]


STEADY = [0.1 * i for i in range(10)]


@pytest.mark.parametrize("wrong", [1e9, 86400.0, 3.0])
def test_one_scan_with_a_wrong_clock_does_not_split_the_stream(wrong):
    found = taken([*STEADY, 1.0 + wrong, 1.1, 1.2])
    assert [one.kind for one in found] == [*[Kind.NEXT] * 10, Kind.LATE, Kind.NEXT, Kind.NEXT]
    assert [one.stamp for one in found[-2:]] == [1.1, 1.2]
    assert sum(bool(one.warning) for one in found) == 1


@pytest.mark.parametrize("pause", [2.0, 3600.0, 1e9])
def test_a_pause_is_one_once_a_second_scan_confirms_it(pause):
    found = taken([*STEADY, 1.0 + pause, 1.1 + pause, 1.2 + pause])
    assert [one.kind for one in found[10:]] == [Kind.LATE, Kind.RESTART, Kind.NEXT]
    assert f"no scans for {pause + 0.1:.1f} s" in found[11].warning


def test_a_clock_that_stands_still_is_replaced_by_counting():
    found = taken([*STEADY, *[0.9] * 4, 1.4, 1.5])
    assert {one.kind for one in found} == {Kind.NEXT}
    np.testing.assert_allclose([one.stamp for one in found[9:]], [0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5])
    assert [i for i, one in enumerate(found) if one.warning] == [10]


def test_a_clock_that_was_set_back_begins_a_new_stream():
    assert kinds([*STEADY, *(-50.0 + 0.1 * i for i in range(6))])[10:] == [*[Kind.LATE] * 4, Kind.RESTART, Kind.NEXT]


def test_without_stamps_scans_are_counted_at_the_given_rate():
    assert [one.stamp for one in taken([None] * 3)] == pytest.approx([0.0, 0.1, 0.2])
    assert [one.stamp for one in taken([None] * 3, rate=5.0)] == pytest.approx([0.0, 0.2, 0.4])
