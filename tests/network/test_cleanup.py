import numpy as np
from grids import even_grid

from automos.network.cleanup import vote
from automos.network.images import RangeImage, Window, make_image

GRID = even_grid(16, 64, 10, -10)


def image_of(points: np.ndarray) -> RangeImage:
    return make_image(Window(points, (), np.zeros((0, 4, 4))), GRID)


def patch(r: float, columns: int, start: int = 20) -> np.ndarray:
    """Return one point in the middle of each pixel of 16 rows and `columns` columns from `start` on, at range `r`."""
    v, u = np.meshgrid(np.arange(16), np.arange(start, start + columns), indexing="ij")
    elevation = np.radians(10 - (v.ravel() + 0.5) / 16 * 20)
    azimuth = np.pi * (1 - 2 * (u.ravel() + 0.5) / 64)
    level = np.cos(elevation)
    return (r * np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], 1)).astype(np.float32)


def test_a_hidden_point_does_not_take_the_label_of_what_hides_it():
    front, behind = patch(5.0, 2, start=23), patch(20.0, 9)
    image = image_of(np.concatenate([front, behind]))
    moving = (image.channels[0] < 10.0).astype(np.float32)  # the network: the near thing moves
    share, _ = vote(image, moving)
    assert (share[: len(front)] > 0.5).all()
    assert (share[len(front) :] < 0.5).all()  # even where all that the pixel shows is the front


def test_a_lone_wrong_pixel_is_outvoted():
    points = patch(10.0, 9)
    image = image_of(points)
    moving = np.zeros((16, 64), np.float32)
    moving[8, 24] = 1.0
    share, mean = vote(image, moving)
    assert (share < 0.5).all()
    assert 0.0 < mean.max() < 0.5


def test_votes_are_the_mean_of_the_nearest_pixels():
    points = patch(10.0, 1)
    image = image_of(points)  # a column: five voters are a pixel, two above, two below
    moving = np.zeros((16, 64), np.float32)
    moving[6:9, 20] = [0.9, 0.8, 0.7]
    share, mean = vote(image, moving)
    assert np.isclose(share[8], 3 / 5)
    assert np.isclose(mean[8], (0.9 + 0.8 + 0.7) / 5)


def test_where_nothing_is_near_enough_the_nearest_pixel_decides():
    front, hidden = patch(5.0, 1)[:1], patch(30.0, 1)[:1]
    image = image_of(np.concatenate([front, hidden]))
    share, _ = vote(image, np.ones((16, 64), np.float32))
    assert share.tolist() == [1.0, 1.0]


def test_points_without_a_pixel_do_not_move():
    points = np.array([[np.nan] * 3, [0.0] * 3, [5.0, 0.0, 0.0]], np.float32)
    share, mean = vote(image_of(points), np.ones((16, 64), np.float32))
    assert share.tolist() == [0.0, 0.0, 1.0]
    assert mean.tolist() == [0.0, 0.0, 1.0]
