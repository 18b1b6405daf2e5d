import numpy as np
import pytest

from automos.objects.paper.verdict import judge_by_trajectory
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.settings import VerdictSettings


def tracks(*centers, size=(4.0, 2.0, 1.5), unseen=()) -> Tracks:
    """Return one track per row of x coordinates (or (n, 3) centres), in boxes of one size."""
    centers = [np.column_stack([c, np.zeros((len(c), 2))]) if np.ndim(c) == 1 else np.asarray(c) for c in centers]
    track = np.repeat(np.arange(len(centers)), [len(c) for c in centers])
    scan = np.concatenate([np.arange(len(c)) for c in centers])
    n = len(track)
    segment = np.where(np.isin(scan, unseen), -1, 0)
    size = np.broadcast_to(np.asarray(size, float), (n, 3)).copy()
    return Tracks(track, scan, segment, np.concatenate(centers), size, np.zeros(n), np.zeros((n, 3)))


def judge(some: Tracks, **settings) -> tuple[str, float]:
    verdicts = judge_by_trajectory(some, VerdictSettings(**settings))
    assert len(verdicts.verdict) == len(verdicts.confidence) == 1
    return Verdict(verdicts.verdict[0]).name, float(verdicts.confidence[0])


JITTER = np.random.default_rng(0).normal(0.0, 0.2, (60, 3))
STRAIGHT = np.arange(11.0)
THERE_AND_BACK = np.r_[np.arange(6.0), np.arange(5.0)[::-1]]


@pytest.mark.parametrize(
    ("centers", "net", "accumulated"),
    [
        (STRAIGHT, "MOVING", "MOVING"),
        (THERE_AND_BACK, "STATIC", "MOVING"),
        (JITTER, "STATIC", "MOVING"),
        (np.full(30, 7.0), "STATIC", "STATIC"),
        (np.linspace(0.0, 3.9, 10), "STATIC", "STATIC"),
        (np.linspace(0.0, 4.1, 10), "MOVING", "MOVING"),
    ],
    ids=["straight", "there and back", "a parked car that jitters", "still", "less than its length", "more"],
)
def test_the_two_readings_of_a_trajectory(centers, net, accumulated):
    assert judge(tracks(centers), trajectory="net")[0] == net
    assert judge(tracks(centers), trajectory="accumulated")[0] == accumulated


@pytest.mark.parametrize(
    ("size", "verdict"),
    [((4, 2, 1.5), "MOVING"), ((2, 4, 1.5), "MOVING"), ((6, 2, 1.5), "STATIC"), ((2, 2, 6), "STATIC")],
)
@pytest.mark.parametrize("trajectory", ["net", "accumulated"])
def test_the_longest_side_counts_whichever_it_is(size, verdict, trajectory):
    assert judge(tracks(np.linspace(0.0, 5.0, 10), size=size), trajectory=trajectory)[0] == verdict


def test_the_largest_box_of_the_track_counts():
    size = np.tile([2.0, 1.0, 1.0], (10, 1))
    size[4] = [6.0, 1.0, 1.0]
    assert judge(tracks(np.linspace(0.0, 5.0, 10), size=size))[0] == "STATIC"
    # but not one that was only predicted
    assert judge(tracks(np.linspace(0.0, 5.0, 10), size=size, unseen=[4]))[0] == "MOVING"


def test_a_trajectory_just_as_long_as_the_box_is_not_longer():
    assert judge(tracks(np.linspace(0.0, 4.0, 9))) == ("STATIC", 0.5)


@pytest.mark.parametrize(("n", "verdict"), [(1, "STATIC"), (2, "STATIC"), (5, "STATIC"), (6, "MOVING")])
def test_what_is_seen_less_often_than_six_times_is_static(n, verdict):
    assert judge(tracks(2.0 * STRAIGHT[:6][-n:] - 2.0 * STRAIGHT[5]))[0] == verdict


def test_scans_in_which_an_object_was_missed_do_not_count_as_seen():
    assert judge(tracks(2.0 * STRAIGHT[:7], unseen=[3]))[0] == "MOVING"
    assert judge(tracks(2.0 * STRAIGHT[:7], unseen=[3, 4]))[0] == "STATIC"


@pytest.mark.parametrize("trajectory", ["net", "accumulated"])
def test_predicted_places_are_no_trajectory(trajectory):
    # seen at 0 throughout, predicted 50 m away once
    centers = np.zeros(10)
    centers[5] = 50.0
    assert judge(tracks(centers, unseen=[5]), trajectory=trajectory)[0] == "STATIC"


@pytest.mark.parametrize(
    ("length", "confidence"), [(0.0, 1.0), (2.0, 0.75), (4.0, 0.5), (6.0, 0.75), (8.0, 1.0), (40.0, 1.0)]
)
def test_confidence_grows_with_the_distance_from_the_threshold(length, confidence):
    assert judge(tracks(np.linspace(0.0, length, 10)))[1] == pytest.approx(confidence)


def test_every_track_is_judged_by_itself():
    verdicts = judge_by_trajectory(tracks(STRAIGHT, np.zeros(8), STRAIGHT[:6]), VerdictSettings())
    np.testing.assert_array_equal(verdicts.verdict, [Verdict.MOVING, Verdict.STATIC, Verdict.MOVING])
    again = Verdicts.from_arrays({**verdicts.to_arrays(), "track": np.zeros(3)})
    np.testing.assert_array_equal(again.verdict, verdicts.verdict)
    np.testing.assert_array_equal(again.confidence, verdicts.confidence)


def test_turning_and_shifting_the_world_changes_no_verdict():
    T = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    for centers in (np.column_stack([STRAIGHT, np.zeros((11, 2))]), JITTER):
        assert judge(tracks(centers @ T.T + 1000.0)) == (
            judge(tracks(centers))[0],
            pytest.approx(judge(tracks(centers))[1]),
        )


def test_no_tracks_have_no_verdicts():
    assert len(judge_by_trajectory(tracks(STRAIGHT)[np.zeros(0, int)], VerdictSettings()).verdict) == 0
