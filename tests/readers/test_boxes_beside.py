import json

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.readers import open_sequence


@pytest.fixture
def folder(tmp_path):
    """Return a folder of two scans of one point, in a box that drives on by a metre."""
    (tmp_path / "labels").mkdir()
    (tmp_path / "boxes").mkdir()
    for i in range(2):
        np.array([5.0 + i, 0.0, 0.0, 1.0], np.float32).tofile(tmp_path / f"{i:06d}.bin")
        np.array([251 + (1 << 16)], np.uint32).tofile(tmp_path / "labels" / f"{i:06d}.label")
        boxes = [{"id": 1, "center": [5.0 + i, 0.0, 0.0], "size": [4.0, 2.0, 2.0], "yaw": 0.0}]
        document = {"boxes": boxes, "T_level_sensor": np.eye(4).tolist()}
        (tmp_path / "boxes" / f"{i:06d}.json").write_text(json.dumps(document))
    return tmp_path


def test_points_move_with_the_boxes_beside_the_scans(folder):
    np.testing.assert_allclose(open_sequence(folder, "bin").truth_motion(0), [[1.0, 0.0, 0.0]])


def test_boxes_beside_the_scans_are_told_with_their_frame(folder):
    ids, boxes, T_boxes_sensor = open_sequence(folder, "bin").truth_boxes(1)
    np.testing.assert_array_equal(ids, [1])
    np.testing.assert_array_equal([*boxes.center[0], *boxes.size[0], *boxes.yaw], [6.0, 0, 0, 4, 2, 2, 0])
    np.testing.assert_array_equal(T_boxes_sensor, np.eye(4))
    (folder / "boxes" / "000000.json").unlink()
    assert open_sequence(folder, "bin").truth_boxes(0) is None


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("center", [0.0, 0.0], "is not a file of boxes"),
        ("center", [float("nan"), 0.0, 0.0], "has a box that is nowhere or has no size"),
        ("size", [-1.0, 2.0, 2.0], "has a box that is nowhere or has no size"),
        ("yaw", float("inf"), "has a box that is nowhere or has no size"),
        ("T_level_sensor", (2.0 * np.eye(4)).tolist(), "holds a pose that is none"),
    ],
)
def test_boxes_that_are_none_are_told_with_their_file(folder, key, value, said):
    path = folder / "boxes" / "000001.json"
    document = json.loads(path.read_text())
    (document if key in document else document["boxes"][0])[key] = value
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=rf"000001\.json {said}"):
        open_sequence(folder, "bin").truth_motion(0)


def test_scans_without_boxes_beside_them_are_not_read(folder, monkeypatch):
    sequence = open_sequence(folder, "bin")
    (folder / "boxes" / "000000.json").unlink()
    monkeypatch.setattr(type(sequence), "__getitem__", lambda *_: 1 / 0)
    monkeypatch.setattr(type(sequence), "truth", lambda *_: 1 / 0)
    assert sequence.truth_motion(0) is None
