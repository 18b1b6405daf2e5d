import numpy as np
from forks import peak_memory

from automos.core.array_sequence import ArraySequence
from automos.core.scan import Sequence
from automos.results.recording_warnings import recording_warnings, scan_rate


def scans(n):
    return [np.full((3, 3), i + 1, np.float32) for i in range(n)]


def test_a_regular_recording_has_none():
    assert recording_warnings(ArraySequence(scans(20), stamps=0.1 * np.arange(20))) == []


def test_missing_scans_are_counted_and_found():
    stamps = 0.1 * np.arange(20)
    stamps[8:] += 0.3  # three scans after the eighth
    (sentence,) = recording_warnings(ArraySequence(scans(20), stamps=stamps))
    assert sentence.startswith("About 3 scans are missing in 1 places; the longest gap is 0.40 s, after scan 000007")


def test_doubled_scans_are_recognised_by_their_points():
    doubled = scans(20)
    doubled[5], doubled[11] = doubled[4], doubled[10]
    (sentence,) = recording_warnings(ArraySequence(doubled), rate=10.0)
    assert sentence == "2 scans are the one before them once more (first: 000005)."


def test_doubled_scans_are_recognised_though_rays_return_nothing():
    doubled = [np.vstack([scan, np.full((2, 3), np.nan, np.float32)]) for scan in scans(20)]
    doubled[5] = doubled[4].copy()
    doubled[8] = doubled[9] = np.full((5, 3), np.nan, np.float32)  # without a point there is nothing to repeat
    (sentence,) = recording_warnings(ArraySequence(doubled), rate=10.0)
    assert sentence == "1 scans are the one before them once more (first: 000005)."


def test_too_few_scans_to_decide_anything_are_told_in_figures():
    (sentence,) = recording_warnings(ArraySequence(scans(2)), rate=10.0)
    assert sentence.startswith("2 scans over 0.1 s are too few to decide what moves")
    assert "there are 0 here and should be 8 or more" in sentence
    assert recording_warnings(ArraySequence(scans(12), stamps=np.arange(12.0))) == []


def test_a_rate_that_is_only_assumed_is_said_and_one_that_is_known_is_not():
    untimed, timed = ArraySequence(scans(20)), ArraySequence(scans(20), stamps=0.2 * np.arange(20))
    (sentence,) = recording_warnings(untimed)
    assert sentence.startswith("No scan has a time: 10 scans a second are assumed.")
    assert recording_warnings(untimed, rate=20.0) == []
    assert scan_rate(untimed) == {"rate_hz": 10.0, "rate_from": "assumed"}
    assert scan_rate(untimed, 20.0) == {"rate_hz": 20.0, "rate_from": "given"}
    assert scan_rate(timed, 20.0) == {"rate_hz": 5.0, "rate_from": "times"}


class Long(Sequence):
    """Two hours of scans, of which only the number and the stamps are known."""

    def __len__(self):
        return 72_000

    @property
    def stamps(self):
        return 0.1 * np.arange(len(self))


def test_the_memory_of_long_recordings_is_that_of_a_few_of_their_scans():
    assert recording_warnings(Long()) == []
    peak = peak_memory(lambda: recording_warnings(Long()))
    assert peak < 200e6  # a distance from each scan to each other one would be 41 GB
