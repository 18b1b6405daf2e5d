import numpy as np
import pytest

from automos.core.errors import InputError
from automos.readers import open_sequence

MOUNTS = """
- {name: roof, rings: [0, 31]}
- {name: rear, rings: [32, 63], translation: [-3.0, 0.5, -0.4], rotation: [0, 0, 1, 0]}
"""


def folder(tmp_path, write_points, columns, text=MOUNTS):
    for i in range(2):
        write_points(tmp_path / f"{i}.pcd", columns)
    (tmp_path / "mounts.yaml").write_text(text)
    return tmp_path


def test_a_side_file_says_where_each_lidar_sits_and_which_rings_are_its_own(tmp_path, write_points, columns):
    sequence = open_sequence(folder(tmp_path, write_points, columns))
    scan = sequence[1]
    np.testing.assert_array_equal(scan.sensor, columns["ring"] >= 32)
    np.testing.assert_allclose(scan.T_scan_sensor[0], np.eye(4))
    np.testing.assert_allclose(scan.T_scan_sensor[1], [[-1, 0, 0, -3], [0, -1, 0, 0.5], [0, 0, 1, -0.4], [0, 0, 0, 1]])
    before = sequence.fingerprint()
    (tmp_path / "mounts.yaml").write_text(MOUNTS.replace("-3.0", "-3.1"))
    assert open_sequence(tmp_path).fingerprint() != before


def test_a_column_may_say_which_lidar_a_point_is_from(tmp_path, write_points, columns):
    sensor = (np.arange(500) % 2).astype(np.uint8)
    text = "- {name: a}\n- {name: b, T_scan_sensor: [[1,0,0,2],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}\n"
    scan = open_sequence(folder(tmp_path, write_points, {**columns, "lidar_id": sensor}, text))[0]
    np.testing.assert_array_equal(scan.sensor, sensor)
    assert scan.T_scan_sensor[1, 0, 3] == 2.0


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (
            "- {name: b, T_scan_sensor: [[2,0,0,2],[0,2,0,0],[0,0,2,0],[0,0,0,1]]}",
            "mount of b is not a rigid transform",
        ),
        ("- {name: b, T_scan_sensor: [[1,0,0],[0,1,0],[0,0,1]]}", "mount of b is not a rigid transform"),
        ("- {name: b, rotation: [0, 0, 0, 0.5]}", "mount of b is not a rigid transform: its quaternion has norm 0.5"),
        ("- {name: b, rotation: [.nan, 0, 0, 1]}", "mount of b is not a rigid transform"),
        ("- {name: b, translation: here}", "b needs a translation of 3 numbers"),
        ("- {name: b, place: [0, 0, 0]}", "b has 'place', but a mount has"),
        ("- {name: b, rings: 5}", "the rings of b must be its first and last"),
        ("- {name: b, rings: [31, 0]}", "the rings of b must be its first and last"),
        ("- {name: b, rings: [0, 32]}\n- {name: a, rings: [32, 63]}", "ring 32 is of both b and a; give it to one"),
        ("- {name: b, rings: [9, 9]}\n- {name: a, rings: [0, 63]}", "ring 9 is of both a and b; give it to one"),
        ("rear: [0, 0, 0]", "must be a list of LiDARs"),
        ("- {name: [", "is not YAML"),
    ],
)
def test_mounts_that_cannot_be_are_told(tmp_path, write_points, columns, text, why):
    with pytest.raises(InputError, match=why):
        open_sequence(folder(tmp_path, write_points, columns, text))


def test_points_of_no_mounted_lidar_are_told(tmp_path, write_points, columns):
    sequence = open_sequence(folder(tmp_path, write_points, columns, MOUNTS.replace("63", "50")))
    with pytest.raises(InputError, match=r"0.pcd: point 51 is of none of the mounted LiDARs roof, rear"):
        sequence[0]
    sequence = open_sequence(folder(tmp_path, write_points, columns, "- {name: a}\n- {name: b}\n"))
    with pytest.raises(InputError, match="nothing says which of a, b measured a point"):
        sequence[0]


def test_a_scan_without_points_needs_no_columns_that_say_whose_they_are(tmp_path):
    np.save(tmp_path / "0.npy", np.column_stack([np.full((40, 4), 5.0), np.arange(40) % 64]))
    np.save(tmp_path / "1.npy", np.zeros((0, 3)))
    (tmp_path / "mounts.yaml").write_text(MOUNTS)
    scan = open_sequence(tmp_path)[1]
    assert scan.sensor.shape == (0,)
    assert scan.n_sensors == 2
