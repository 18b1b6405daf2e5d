"""A NumPy file of several scans is a recording of them, one scan a file stays one, and what is open is refused."""

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.core.own_sequence import as_sequence
from automos.readers import find_recordings, npy, open_recordings, open_sequence

BEAMS, STEPS, SCANS = 16, 90, 12


@pytest.fixture
def scans():
    """(SCANS, BEAMS, STEPS, 4): images of a sensor, at other ranges in each."""
    rng = np.random.default_rng(0)
    elevation, azimuth = np.meshgrid(np.linspace(-0.3, 0.2, BEAMS), np.linspace(-3, 3, STEPS), indexing="ij")
    rays = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=-1)
    points = rng.uniform(2, 60, (SCANS, BEAMS, STEPS, 1)) * rays
    return np.concatenate([points, rng.uniform(0, 1, (SCANS, BEAMS, STEPS, 1))], axis=-1).astype(np.float32)


def require_same(sequence, rows):
    assert len(sequence) == len(rows)
    for scan, true in zip(sequence, rows, strict=True):
        np.testing.assert_array_equal(scan.points, true[:, :3])
        np.testing.assert_array_equal(scan.intensity, true[:, 3])


@pytest.mark.parametrize("kind", ["rows", "columns", "structured", "archive"])
def test_an_array_of_scans_is_a_recording_of_them(tmp_path, scans, kind):
    rows = scans.reshape(SCANS, -1, 4)
    path = tmp_path / ("drive.npz" if kind == "archive" else "drive.npy")
    if kind == "structured":
        np.save(path, rows.view(np.dtype([(name, "f4") for name in ("x", "y", "z", "intensity")]))[..., 0])
    elif kind == "archive":
        np.savez(path, points=rows, times=np.arange(SCANS) * 0.2 + 5.0)
    else:
        np.save(path, rows if kind == "rows" else rows.swapaxes(1, 2))
    sequence = open_sequence(path)
    require_same(sequence, rows)
    assert sequence.name == "drive"
    assert sequence.source == path
    if kind == "archive":
        np.testing.assert_allclose(np.diff(sequence.stamps), 0.2)
    assert find_recordings(tmp_path) == [path]
    require_same(open_sequence(tmp_path), rows)


def test_an_archive_of_numbered_arrays_has_a_scan_in_each(tmp_path, scans):
    rows = [scan.reshape(-1, 4)[: 500 + i] for i, scan in enumerate(scans)]
    np.savez(tmp_path / "a.npz", *rows)
    np.savez(tmp_path / "b.npz", **{f"scan{i}": scan for i, scan in enumerate(rows)}, stamp=np.arange(SCANS) / 5)
    for sequence in open_recordings(tmp_path):
        require_same(sequence, rows)
    assert sequence.stamps is not None


def test_few_numbered_arrays_are_scans_unless_they_may_be_of_one(tmp_path, scans):
    rows = [scan.reshape(-1, 4) for scan in scans[:3]]
    np.savez(tmp_path / "a.npz", **{f"{i:04d}": scan for i, scan in enumerate(rows)})
    np.savez(tmp_path / "b.npz", *(scan[: 500 + i] for i, scan in enumerate(rows)))
    require_same(open_sequence(tmp_path / "a.npz"), rows)
    assert [len(scan) for scan in open_sequence(tmp_path / "b.npz")] == [500, 501, 502]
    np.savez(tmp_path / "c.npz", rows[0], rows[1])  # NumPy's names, one size: points and their normals
    with pytest.raises(InputError, match=r"c.npz is a file; give the folder"):
        open_sequence(tmp_path / "c.npz")


def test_images_and_matrices_in_files_are_no_stacks(tmp_path, scans):
    for i, scan in enumerate(scans):
        np.save(tmp_path / f"{i:06d}.npy", scan)
    require_same(open_sequence(tmp_path), scans.reshape(SCANS, -1, 4))
    np.save(tmp_path / "poses.npy", np.tile(np.eye(4), (SCANS, 1, 1)))
    assert find_recordings(tmp_path) == [tmp_path]
    with pytest.raises(InputError, match=r"000000.npy is a file; give the folder that holds the scans"):
        open_sequence(tmp_path / "000000.npy")


def test_a_stack_among_scans_is_told(tmp_path, scans):
    np.save(tmp_path / "000000.npy", scans[0])
    np.save(tmp_path / "000001.npy", scans.reshape(SCANS, -1, 4))
    with pytest.raises(InputError, match=r"000001.npy holds 12 scans, an array of shape .*; give this file itself"):
        open_sequence(tmp_path)[1]


def test_what_may_be_either_is_refused_where_it_is_all_there_is(tmp_path, scans):
    np.save(tmp_path / "drive.npy", scans[0] + np.float32([1.0, 0.0, 1.7, 0.0]))
    for path in (tmp_path, tmp_path / "drive.npy"):
        with pytest.raises(InputError, match=r"drive.npy holds an array whose rows may be scans or parts of one"):
            open_sequence(path)


def test_of_further_stacks_in_a_folder_headers_are_read(tmp_path, scans, monkeypatch):
    rows, read = scans.reshape(SCANS, -1, 4), []
    for k in range(3):
        np.save(tmp_path / f"{k}.npy", rows)
    whole = npy.load
    monkeypatch.setattr(npy, "load", lambda path: read.append(path.name) or whole(path))
    found = find_recordings(tmp_path)
    assert (len(found), read) == (3, ["0.npy"])
    np.save(tmp_path / "1.npy", scans[0])
    with pytest.raises(InputError, match=r"1.npy holds one scan, and others beside it hold several"):
        open_recordings(tmp_path)
    np.save(tmp_path / "1.npy", rows[0])
    assert find_recordings(tmp_path) == [tmp_path]


def test_a_damaged_file_is_told(tmp_path, scans):
    path = tmp_path / "drive.npy"
    np.save(path, scans.reshape(SCANS, -1, 4))
    path.write_bytes(path.read_bytes()[:-9])
    for given in (path, tmp_path):
        with pytest.raises(InputError, match=r"drive.npy is not a whole .npy file"):
            open_sequence(given)


def test_in_memory_an_array_is_what_it_is_in_a_file(scans):
    require_same(as_sequence(scans.reshape(SCANS, -1, 4)), scans.reshape(SCANS, -1, 4))
    with pytest.raises(InputError, match=r"one array of shape \(16, 90, 4\) is one scan: give a list"):
        as_sequence(scans[0])
    with pytest.raises(
        InputError, match=r"\(16, 90, 3\) may be 16 scans or one, as its points do not tell: give a list"
    ):
        as_sequence(scans[0, ..., :3] + [1.0, 0.0, 1.7])
    for n_columns in (2, 6):
        with pytest.raises(InputError, match=r"scan 0 must be \(N, 3 or 4\)"):
            as_sequence(scans.reshape(SCANS, -1, n_columns))
