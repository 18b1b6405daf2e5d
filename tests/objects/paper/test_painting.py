import numpy as np
import pytest

from automos.objects.paper.painting import paint_points
from automos.objects.tracks import Tracks

# along x, half a metre apart, from 0 to 9.5
POINTS = np.column_stack([np.arange(0.0, 10.0, 0.5), np.zeros((20, 2))]).astype(np.float32)
NO_SEGMENT = np.full(20, -1, np.int32)


def moving(*rows) -> Tracks:
    """Return rows (track, segment, x of the box's centre) of moving tracks, in boxes 2 m long."""
    track, segment, x = (np.array(column) for column in zip(*rows, strict=True)) if rows else [np.zeros(0, int)] * 3
    n = len(track)
    center = np.column_stack([x, np.zeros((n, 2))]).astype(float)
    return Tracks(track, np.zeros(n, int), segment, center, np.tile([2.0, 1, 1], (n, 1)), np.zeros(n), np.zeros((n, 3)))


def painted(points, ids, here) -> list[int]:
    """Return the track of each point."""
    tracks = paint_points(points, ids, here)
    assert tracks.dtype == np.int32
    return tracks.tolist()


def test_every_point_in_a_moving_box_is_moving_and_no_other():
    # from 2 to 4 m: points 4 to 8, the border included
    assert painted(POINTS, NO_SEGMENT, moving((7, -1, 3.0))) == [7 if 4 <= i <= 8 else -1 for i in range(20)]


def test_a_segment_moves_with_its_track_where_it_reaches_out_of_the_box():
    ids = NO_SEGMENT.copy()
    ids[6:14] = 3
    assert painted(POINTS, ids, moving((7, 3, 3.0))) == [7 if 4 <= i <= 13 else -1 for i in range(20)]


def test_a_segments_points_are_its_own_tracks_even_in_another_tracks_box():
    ids = NO_SEGMENT.copy()
    ids[6:8] = 1
    # the first box holds points 4 to 8, the second 8 to 12
    expected = {4: 7, 5: 7, 6: 9, 7: 9, 8: 7, 9: 9, 10: 9, 11: 9, 12: 9}
    assert painted(POINTS, ids, moving((7, -1, 3.0), (9, 1, 5.0))) == [expected.get(i, -1) for i in range(20)]


def test_a_missed_object_paints_its_predicted_box_and_no_segment():
    ids = NO_SEGMENT.copy()
    ids[15:] = 0
    assert painted(POINTS, ids, moving((7, -1, 3.0))) == [7 if 4 <= i <= 8 else -1 for i in range(20)]


def test_segments_of_tracks_that_do_not_move_are_static():
    ids = np.arange(20, dtype=np.int32) // 5
    assert painted(POINTS, ids, moving((4, 2, 30.0))) == [4 if 10 <= i <= 14 else -1 for i in range(20)]


@pytest.mark.parametrize("ids", [NO_SEGMENT, np.zeros(20, np.int32)], ids=["no segments", "a segment"])
def test_where_nothing_moves_every_point_is_static(ids):
    assert painted(POINTS, ids, moving()) == [-1] * 20


def test_a_scan_without_points_has_no_labels():
    assert painted(POINTS[:0], NO_SEGMENT[:0], moving((7, -1, 3.0))) == []


def test_a_track_of_a_segment_that_is_in_no_list_has_its_box():
    # `tracking.method: paper` with the instances of `default`, whose segments that have stayed are listed apart
    assert painted(POINTS, NO_SEGMENT, moving((7, 66, 3.0))) == [7 if 4 <= i <= 8 else -1 for i in range(20)]
