from concurrent.futures import ThreadPoolExecutor
from threading import Event

import numpy as np
import pytest
from worlds import lane

import automos
from automos.core.errors import InputError
from automos.labeler import Stream
from automos.online.guard import Guard

SCANS = list(lane(12).sequence)


def test_of_two_who_come_at_once_the_second_is_refused_and_may_come_again():
    guard, is_in, may_leave = Guard(), Event(), Event()

    def stay() -> None:
        with guard.alone():
            is_in.set()
            may_leave.wait(30.0)

    with ThreadPoolExecutor(1) as pool:
        staying = pool.submit(stay)
        assert is_in.wait(30.0)
        with pytest.raises(InputError, match="pushed into this Labeler already"), guard.alone():
            pass
        may_leave.set()
        staying.result()
    with guard.alone():
        pass


def test_who_pushes_in_the_middle_of_push_each_is_refused():
    labeler = automos.Labeler(is_compensated=True)
    ahead = labeler.push_each(SCANS[:3])
    next(ahead)
    with pytest.raises(InputError, match="push from one at a time"):
        labeler.push(SCANS[3])
    assert len(list(ahead)) == 2


def test_after_an_interrupt_a_labeler_says_so_and_begins_anew_after_finish(monkeypatch):
    alone = [g for scan in SCANS for g in automos.Labeler.push(fresh, scan)] if (fresh := new()) else []
    labeler, follow = new(), Stream.follow
    for scan in SCANS[:3]:
        labeler.push(scan)

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Stream, "follow", interrupted)
    with pytest.raises(KeyboardInterrupt):
        labeler.push(SCANS[3])
    monkeypatch.setattr(Stream, "follow", follow)
    with pytest.raises(InputError, match="interrupted in the middle of a scan: call finish"):
        labeler.push(SCANS[4])
    assert labeler.finish() == []  # the first three were returned, and of the fourth nothing is certain
    again = [g for scan in SCANS for g in labeler.push(scan)]
    for one, other in zip(again, alone, strict=True):
        np.testing.assert_array_equal(one.labels, other.labels)


def new() -> automos.Labeler:
    return automos.Labeler(is_compensated=True)
