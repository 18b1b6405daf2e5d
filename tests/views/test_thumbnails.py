"""Pictures of tracks: what is parked stays in place, what drives leaves a trace."""

import base64

import numpy as np

from automos.views.ground_map import GRID, Thumbnails


def track(centers):
    boxes = [
        {"scan": i, "observed": True, "center": [x, 0.0, 0.75], "size": [4.0, 2.0, 1.5], "yaw": 0.0}
        for i, x in enumerate(centers)
    ]
    return {"id": 7, "boxes": boxes}


def picture(centers):
    made = Thumbnails([track(centers)])
    body = np.random.default_rng(0).uniform([-1.9, -0.9, 0.3], [1.9, 0.9, 1.4], (300, 3))
    around = np.array([[2.0, 3.0, 1.0], [2.0, -3.0, 0.05]])  # something standing, and ground
    for i, x in enumerate(centers):
        made.add(i, np.vstack([body + np.array([x, 0.0, 0.0]), around]))
    page = made.to_page()[7]
    rows = np.frombuffer(base64.b64decode(page["points"]), np.uint8).reshape(-1, 3).astype(float)
    x = page["center"][0] + rows[:, 0] * 2 * page["half"] / GRID - page["half"]
    return x, rows[:, 2]


def test_a_parked_car_is_drawn_at_one_place_at_all_moments():
    x, shade = picture([5.0] * 10)
    assert sorted(set(shade)) == [0, 1, 2, 3, 4, 5, 255]
    means = [x[shade == k].mean() for k in range(6)]
    np.testing.assert_allclose(means, 5.0, atol=0.2)


def test_a_driving_car_is_drawn_along_its_way():
    x, shade = picture(np.linspace(0.0, 20.0, 11))
    means = [x[shade == k].mean() for k in range(6)]
    np.testing.assert_allclose(means, [0.0, 4.0, 8.0, 12.0, 16.0, 20.0], atol=0.3)


def test_of_the_surroundings_only_what_stands_is_drawn():
    x, shade = picture([0.0, 0.0, 0.0])
    assert (shade == 255).sum() == 1
    assert abs(x[shade == 255][0] - 2.0) < 0.1


def test_a_track_that_no_scan_shows_has_an_empty_picture():
    assert Thumbnails([track([0.0])]).to_page()[7]["points"] == ""
