"""Archives of recordings, and of a cloud each: read as what is in them."""

import pickle
import zipfile

import numpy as np
import pytest
from point_writers import write_points

from automos.core.errors import InputError
from automos.readers import find_recordings, open_sequence

SUFFIXES = (".pcd", ".ply", ".npy", ".xyz", ".bin")


def clouds(n=12, n_points=1500):
    rng = np.random.default_rng(0)
    return [
        np.column_stack([rng.normal(0.0, 8.0, (n_points, 3)), rng.uniform(0, 1, n_points)]).astype(np.float32)
        for _ in range(n)
    ]


def write_scan(path, rows):
    columns = dict(zip(("x", "y", "z", "intensity"), rows.T, strict=True))
    if path.suffix == ".bin":
        rows.tofile(path)
    else:
        write_points(path, columns)


def write_drive(folder, suffix, scans):
    folder.mkdir(parents=True)
    for k, rows in enumerate(scans):
        write_scan(folder / f"{k:06d}{suffix}", rows)
    return folder


def pack(path, folder, inside=""):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.rglob("*")):
            archive.write(file, f"{inside}{file.relative_to(folder)}")
    return path


@pytest.mark.parametrize("inside", ["", "drive/", "data set/drive/"])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_recording_in_an_archive_is_read_as_if_it_were_unpacked(tmp_path, suffix, inside):
    drive = write_drive(tmp_path / "drive", suffix, clouds())
    path = pack(tmp_path / "packed.zip", drive, inside)
    assert find_recordings(path) == [path]
    sequence, plain = open_sequence(path), open_sequence(drive)
    assert (sequence.name, sequence.address, sequence.names) == ("packed", path, plain.names)
    copy = pickle.loads(pickle.dumps(sequence))
    for k in range(len(plain)):
        np.testing.assert_array_equal(sequence[k].points, plain[k].points)
        np.testing.assert_array_equal(copy[k].intensity, plain[k].intensity)
    assert sequence.fingerprint() == open_sequence(path).fingerprint()


@pytest.mark.parametrize("inside", ["", "drive/", "drive/velodyne/"])
def test_an_archive_of_one_scan_is_a_recording_of_one(tmp_path, inside):
    scans = clouds(1)
    (scan,) = open_sequence(pack(tmp_path / "packed.zip", write_drive(tmp_path / "drive", ".bin", scans), inside))
    np.testing.assert_array_equal(scan.points, scans[0][:, :3])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_folder_of_archives_of_a_cloud_each_is_a_recording(tmp_path, suffix):
    plain = write_drive(tmp_path / "drive", suffix, clouds(4))
    (tmp_path / "packed").mkdir()
    for file in plain.iterdir():
        with zipfile.ZipFile(tmp_path / "packed" / f"{file.stem}.zip", "w") as archive:
            archive.write(file, file.name)
    sequence = open_sequence(tmp_path / "packed")
    for got, true in zip(sequence, open_sequence(plain), strict=True):
        np.testing.assert_array_equal(got.points, true.points)


def test_folders_may_be_divided_by_backslashes_and_notes_may_lie_above_the_recording(tmp_path):
    drive = write_drive(tmp_path / "drive", ".bin", clouds())
    (drive / "times.txt").write_text("\n".join(str(0.1 * k) for k in range(12)))
    with zipfile.ZipFile(tmp_path / "packed.zip", "w") as archive:
        archive.writestr("day\\notes.txt", "12 scans")
        for file in drive.iterdir():
            archive.writestr(f"day\\drive\\{file.name}", file.read_bytes())
    sequence = open_sequence(tmp_path / "packed.zip")
    np.testing.assert_allclose(sequence.stamps, 0.1 * np.arange(12))
    np.testing.assert_array_equal(sequence[3].points, open_sequence(drive)[3].points)


def test_other_files_and_folders_may_be_packed_beside_the_recording(tmp_path):
    path, scans = tmp_path / "packed.zip", clouds(6)
    drive = write_drive(tmp_path / "drive", ".bin", scans)
    with zipfile.ZipFile(path, "w") as archive:
        for file in drive.iterdir():
            archive.write(file, f"d/lidar/{file.name}")
            archive.writestr(f"__MACOSX/d/lidar/._{file.name}", b"\0\5\26\7")
        archive.writestr("README.md", b"a drive")
        archive.writestr("d/camera/000000.png", b"\x89PNG")
        archive.writestr("d/calib.json", b"{}")
    sequence = open_sequence(path)
    assert (sequence.name, len(sequence)) == ("packed", 6)
    np.testing.assert_array_equal(sequence[3].points, scans[3][:, :3])


def test_an_archive_beside_scans_is_no_scan(tmp_path):
    drive = write_drive(tmp_path / "drive", ".pcd", clouds(3))
    pack(drive / "pictures.zip", write_drive(tmp_path / "other", ".npy", clouds(1)))
    assert len(open_sequence(drive)) == 3


def test_archives_that_are_cut_encrypted_or_of_several_recordings_are_told(tmp_path):
    drive = write_drive(tmp_path / "drive", ".npy", clouds(3))
    path = pack(tmp_path / "packed.zip", drive)
    raw = path.read_bytes()
    path.write_bytes(raw[:-40])
    with pytest.raises(InputError, match=r"packed.zip cannot be unpacked .*; unpack it yourself, or copy it again"):
        open_sequence(path)
    path.write_bytes(raw[:200] + bytes([raw[200] ^ 255]) + raw[201:])
    with pytest.raises(InputError, match=r"packed.zip cannot be unpacked"):
        open_sequence(path)
    with zipfile.ZipFile(path, "w") as archive:
        for name in "ab":
            for file in drive.iterdir():
                archive.write(file, f"{name}/{file.name}")
    with pytest.raises(InputError, match=r"packed.zip|packed holds no scans itself, but these folders in it do: a, b"):
        open_sequence(path)
    (tmp_path / "scans").mkdir()
    pack(tmp_path / "scans" / "1.zip", drive)
    with pytest.raises(InputError, match=r"1.zip holds 3 clouds, where a scan is one .*; .* give the archive itself"):
        open_sequence(tmp_path / "scans")


def test_nothing_is_unpacked_outside_or_beyond_the_disk(tmp_path, monkeypatch):
    with zipfile.ZipFile(tmp_path / "evil.zip", "w") as archive:
        archive.writestr("../../outside.txt", "1 2 3\n4 5 7\n")
        archive.writestr("a.txt", "1 2 3\n4 5 6\n")
    assert len(open_sequence(tmp_path / "evil.zip")) == 2  # each within its folder
    assert not list(tmp_path.parent.glob("outside.txt"))
    path = pack(tmp_path / "packed.zip", write_drive(tmp_path / "drive", ".npy", clouds(3)))
    usage = type("Usage", (), {"free": 1000})
    monkeypatch.setattr("shutil.disk_usage", lambda place: usage)
    with pytest.raises(InputError, match=r"packed.zip unpacks to 0 MB, and .* has room for 0"):
        open_sequence(path)
