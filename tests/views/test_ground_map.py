"""The map from above, and the pictures it is made of."""

import base64
import io

import matplotlib.image
import numpy as np

from automos.views.ground_map import REACH, GroundMap, palette_png
from automos.views.topdown import MISSED, MOVING, STATIC


def read(address):
    return matplotlib.image.imread(io.BytesIO(base64.b64decode(address.split(",")[1])))


def test_a_palette_picture_is_read_back_by_another_library():
    image = np.array([[0, 1, 2], [2, 1, 0]], np.uint8)
    colors = np.array([[0, 0, 0, 0], [255, 0, 0, 255], [0, 0, 255, 102]], np.uint8)
    found = matplotlib.image.imread(io.BytesIO(palette_png(image, colors)))
    np.testing.assert_allclose(found, colors[image] / 255.0)


def test_points_are_drawn_where_they_are_in_the_layer_of_their_kind():
    made = GroundMap(np.zeros((1, 3)))
    points = np.array([[10.0, 20.0, 0.0], [10.0, 20.0, 2.9], [-30.0, 5.0, 1.0], [1.0, -40.0, 0.0], [1e4, 0, 0]])
    made.add(points, np.array([STATIC, STATIC, MOVING, MISSED, MOVING], np.uint8))
    page = made.to_page()
    assert list(page["layers"]) == ["static", "moving", "missed"]  # nothing false, so no layer of it
    for layer, (x, y) in {"static": (10.0, 20.0), "moving": (-30.0, 5.0), "missed": (1.0, -40.0)}.items():
        picture = read(page["layers"][layer])
        row, column = np.argwhere(picture[..., 3] > 0).mean(axis=0)
        # the picture's top is north; a pixel's middle is half a cell from its corner
        assert abs(page["low"][0] + (column + 0.5) * page["cell"] - x) < page["cell"]
        assert abs(page["low"][1] + (page["height"] - row - 0.5) * page["cell"] - y) < page["cell"]
    static = read(page["layers"]["static"])
    assert static[static[..., 3] > 0][0, 0] < 0.5  # a wall, not the ground


def test_a_long_drive_gets_coarser_cells_not_a_larger_picture():
    made = GroundMap(np.array([[0.0, 0.0], [5000.0, 300.0]]))
    assert max(made.shape) <= 1301
    assert made.cell * made.shape[1] >= 5000.0 + 2 * REACH


def test_a_slope_is_ground_all_the_way():
    made = GroundMap(np.zeros((1, 3)))
    x, y = np.meshgrid(np.arange(-50.0, 50.0, 0.2), np.arange(-5.0, 5.0, 0.2))
    points = np.column_stack([x.ravel(), y.ravel(), 0.1 * x.ravel()])  # ten metres over a hundred
    made.add(points, np.zeros(len(points), np.uint8))
    picture = read(made.to_page()["layers"]["static"])
    shown = picture[picture[..., 3] > 0][:, 0]
    assert np.quantile(shown, 0.01) > 0.8
