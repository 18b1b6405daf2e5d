"""A body whose points stand where static things stand has not moved."""

from types import SimpleNamespace

import numpy as np

from automos.objects.places import Places, count_places, held_places, touched_columns
from automos.objects.tracking import Scans, without_standing
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts


class Segments:
    """The first half of the points of every scan are segment 0, the others segment 1."""

    def load(self, name, *keys):
        ids = np.repeat([0, 1], 10).astype(np.int32)
        return {"ids": ids, "stayed": np.full(20, -1, np.int32)}


def test_of_two_bodies_the_one_on_static_places_has_not_moved():
    bush = np.random.default_rng(1).uniform(0.0, 0.9, (10, 3)) + np.array([20.0, 5.0, 0.0])
    frames = [SimpleNamespace(points_level=np.vstack([bush, bush + np.array([3.0 * i, 20.0, 0.0])])) for i in range(4)]
    track, segment = np.repeat([0, 1], 4), np.repeat([0, 1], 4)
    center = np.array([frames[i].points_level[10 * k : 10 * k + 10].mean(axis=0) for k in (0, 1) for i in range(4)])
    many = np.ones((8, 3))
    parts = Tracks(track, np.tile(np.arange(4), 2), segment, center, many, np.zeros(8), 0.0 * many)
    verdicts = Verdicts(np.full(2, Verdict.MOVING, np.int8), np.array([0.9, 0.8]))
    columns, yes = touched_columns(parts.boxes), np.ones(10, np.bool_)
    seen_before = [held_places(bush, ~yes, yes, columns)] * 9 + [held_places(bush, yes, ~yes, columns)] * 4
    places = Places(count_places(seen_before), verdicts.is_moving)
    scans = Scans(frames, ["0", "1", "2", "3"], None, Segments())
    found = without_standing(scans, parts, places, verdicts, 1)
    np.testing.assert_array_equal(found.verdict, [Verdict.STATIC, Verdict.MOVING])
    np.testing.assert_allclose(found.confidence, [1.0, 0.8])
    same = without_standing(scans, parts, Places(places.keys[:0], verdicts.is_moving), verdicts, 1)
    np.testing.assert_array_equal(same.verdict, verdicts.verdict)
