import numpy as np

from automos.objects.tracks import Tracks, without_gaps


def table() -> Tracks:
    """Return three tracks of 2, 1 and 3 rows."""
    track = np.array([0, 0, 1, 2, 2, 2])
    return Tracks(
        track=track,
        scan=np.array([0, 1, 1, 3, 4, 5]),
        segment=np.array([4, 0, 1, 2, -1, 0]),
        center=np.arange(18.0).reshape(6, 3),
        size=np.ones((6, 3)),
        yaw=np.zeros(6),
        velocity=np.zeros((6, 3)),
    )


def test_a_table_is_as_long_as_it_has_tracks():
    assert len(table()) == 3
    assert len(table()[np.zeros(0, int)]) == 0


def test_the_rows_of_a_track():
    assert [(rows.start, rows.stop) for rows in map(table().rows_of, range(4))] == [(0, 2), (2, 3), (3, 6), (6, 6)]


def test_an_object_is_observed_where_a_segment_was_matched():
    np.testing.assert_array_equal(table().is_observed, [True, True, True, True, False, True])


def test_rows_are_picked_in_all_columns():
    some = table()[np.array([5, 0])]
    np.testing.assert_array_equal(some.track, [2, 0])
    np.testing.assert_array_equal(some.boxes.center, [[15, 16, 17], [0, 1, 2]])


def test_tracks_are_taken_apart_and_put_together():
    again = Tracks.from_arrays({**table().to_arrays(), "verdict": np.zeros(3)})  # saved beside other columns
    for name, column in table().to_arrays().items():
        np.testing.assert_array_equal(getattr(again, name), column)


def test_a_body_has_a_row_in_every_scan_from_its_first_to_its_last_one():
    track, scan = np.array([0, 0, 0, 1, 1]), np.array([2, 3, 6, 1, 3])
    nowhere = np.arange(15.0).reshape(5, 3)
    table = Tracks(track, scan, np.arange(5), nowhere, nowhere, np.arange(5.0), nowhere)
    whole = without_gaps(table)
    assert whole.track.tolist() == [0, 0, 0, 0, 0, 1, 1, 1]
    assert whole.scan.tolist() == [2, 3, 4, 5, 6, 1, 2, 3]
    assert whole.segment.tolist() == [0, 1, -1, -1, 2, 3, -1, 4]
    assert whole.yaw.tolist() == [0, 1, 1, 1, 2, 3, 3, 4]
    assert without_gaps(whole) is whole
    assert len(without_gaps(table[:0])) == 0


def test_more_tables_than_are_joined_at_a_time_are_sorted_as_a_few_are():
    n, scans = 7, 250
    column = np.random.default_rng(0).normal(size=(n * scans, 3))
    whole = Tracks(*np.divmod(np.arange(n * scans), scans), np.arange(n * scans), column, column, column[:, 0], column)
    found = Tracks.concatenate(whole[np.flatnonzero(whole.scan == scan)] for scan in range(scans))
    for name, values in whole.to_arrays().items():
        np.testing.assert_array_equal(getattr(found, name), values)
