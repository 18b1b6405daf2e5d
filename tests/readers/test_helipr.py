import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from street_log import street_log

from automos.core.errors import InputError
from automos.readers import open_recordings, open_sequence

SWITCH = 1691936557946849179
"""Up to this time the Aeva was recorded without intensity."""


def packed(sensor, scan, with_intensity=True):
    """Return the bytes of a scan as the sensor's recorder packs them, point by point."""
    rows = []
    for k in range(len(scan)):
        x, y, z = scan.points[k].tolist()
        value, ring, seconds = float(scan.intensity[k]), int(scan.ring[k]), float(scan.time[k])
        ns = round(seconds * 1e9)
        match sensor:
            case "Velodyne":
                rows.append(struct.pack("<ffffHf", x, y, z, value, ring, seconds))
            case "Ouster":
                rows.append(struct.pack("<ffffIHHH", x, y, z, value, ns, 1, ring, 2))
            case "Avia":
                rows.append(struct.pack("<fffBBBI", x, y, z, int(value), 3, ring, ns))
            case "Aeva":
                row = struct.pack("<fffffiB", x, y, z, 0.5, -1.0, ns, ring)
                rows.append(row + struct.pack("<f", value) if with_intensity else row)
    return b"".join(rows)


def write_sensor(root, sensor, log, shift=0, with_intensity=True):
    folder = root / "LiDAR" / sensor
    folder.mkdir(parents=True)
    (root / "LiDAR_GT").mkdir(exist_ok=True)
    lines = []
    for scan, t, T in zip(log.scans, log.nanoseconds + shift, log.T_ground_sensor, strict=True):
        (folder / f"{t}.bin").write_bytes(packed(sensor, scan, with_intensity))
        q = Rotation.from_matrix(T[:3, :3]).as_quat()
        lines.append(" ".join([str(t), *(f"{v:.12f}" for v in (*T[:3, 3], *q))]))
    (root / "LiDAR_GT" / f"{sensor}_gt.txt").write_text("\n".join(lines) + "\n")
    return folder


@pytest.mark.parametrize("sensor", ["Velodyne", "Ouster", "Avia", "Aeva"])
def test_each_sensors_structs_are_read_whole(tmp_path, sensor):
    log = street_log()
    shift = SWITCH + 10 - log.nanoseconds[0]
    write_sensor(tmp_path / "KAIST05", sensor, log, shift)
    sequence = open_sequence(tmp_path / "KAIST05")
    assert (sequence.name, len(sequence)) == (f"KAIST05_{sensor}", 12)
    for got, true in zip(sequence, log.scans, strict=True):
        np.testing.assert_array_equal(got.points, true.points)
        np.testing.assert_array_equal(got.intensity, true.intensity)
        np.testing.assert_array_equal(got.ring, true.ring)
        np.testing.assert_allclose(got.time, true.time, atol=2e-7)
    np.testing.assert_allclose(np.diff(sequence.stamps), 0.1, atol=1e-6)
    np.testing.assert_allclose(sequence.reference_poses, log.poses, atol=1e-6)


def test_early_scans_of_the_aeva_have_no_intensity(tmp_path):
    log = street_log()
    write_sensor(tmp_path / "KAIST05", "Aeva", log, SWITCH - log.nanoseconds[0] - 150_000_000, with_intensity=False)
    sequence = open_sequence(tmp_path / "KAIST05")
    assert sequence[0].intensity is None
    assert len(sequence[0]) == len(log.scans[0])
    with pytest.raises(InputError, match="no multiple of a point"):  # those after the switch must have it
        sequence[5]


def test_every_sensor_of_a_drive_is_a_recording(tmp_path):
    for sensor in ("Ouster", "Avia"):
        write_sensor(tmp_path / "KAIST05", sensor, street_log())
    assert [s.name for s in open_recordings(tmp_path / "KAIST05")] == ["KAIST05_Avia", "KAIST05_Ouster"]
    with pytest.raises(InputError, match=r"holds 2 recordings \(Avia, Ouster\); give one"):
        open_sequence(tmp_path / "KAIST05")
    assert len(open_sequence(tmp_path / "KAIST05" / "LiDAR" / "Ouster")) == 12
    (tmp_path / "KAIST05" / "LiDAR_GT" / "Ouster_gt.txt").unlink()
    assert open_sequence(tmp_path / "KAIST05" / "LiDAR" / "Ouster").reference_poses is None
