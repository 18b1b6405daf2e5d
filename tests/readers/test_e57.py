"""E57 files, written by pye57."""

from types import SimpleNamespace

import numpy as np
import pytest

from automos.core.errors import InputError, MissingExtraError
from automos.readers import e57, open_sequence

pye57 = pytest.importorskip("pye57", reason="pip install '.[e57]'")


def write(path, *scans):
    file = pye57.E57(str(path), mode="w")
    for columns in scans:
        file.write_scan_raw({name: np.asarray(column) for name, column in columns.items()})
    file.close()
    return path


def cloud(seed, n=500):
    rng = np.random.default_rng(seed)
    return {f"cartesian{axis}": rng.normal(0.0, 9.0, n) for axis in "XYZ"} | {"intensity": rng.uniform(0, 1, n)}


def test_each_file_is_a_scan_in_its_scanners_frame(tmp_path):
    for k in range(3):
        write(tmp_path / f"{k}.e57", cloud(k))
    sequence = open_sequence(tmp_path)
    assert len(sequence) == 3
    for k, scan in enumerate(sequence):
        true = cloud(k)
        np.testing.assert_allclose(scan.points, np.stack([true[f"cartesian{a}"] for a in "XYZ"], axis=1), atol=1e-5)
        np.testing.assert_allclose(scan.intensity, true["intensity"], atol=1e-6)


def test_points_without_a_return_are_none_and_rays_become_points(tmp_path):
    columns = cloud(0) | {"cartesianInvalidState": np.arange(500) % 2}
    write(tmp_path / "0.e57", columns)
    points = open_sequence(tmp_path)[0].points
    assert not points[1::2].any()
    assert points[::2].any(axis=1).all()


def test_rays_become_points(tmp_path, monkeypatch):
    turns = np.radians([[0, 90, 180, 0], [0, 0, 0, 30]])
    raw = {"sphericalRange": np.full(4, 2.0), "sphericalAzimuth": turns[0], "sphericalElevation": turns[1]}
    file = SimpleNamespace(scan_count=1, read_scan_raw=lambda index: raw)
    monkeypatch.setattr(pye57, "E57", lambda path: file)
    columns = e57.read_here(tmp_path / "0.e57")
    wanted = [[2, 0, 0], [0, 2, 0], [-2, 0, 0], [np.sqrt(3), 0, 1]]
    np.testing.assert_allclose(np.stack([columns[axis] for axis in "xyz"], axis=1), wanted, atol=1e-12)


def test_files_of_several_scans_or_damaged_ones_are_told(tmp_path, monkeypatch):
    path = write(tmp_path / "0.e57", cloud(0), cloud(1))
    with pytest.raises(InputError, match=r"0.e57 holds 2 scans; export each to a file of its own"):
        open_sequence(tmp_path)
    raw = write(path, cloud(0)).read_bytes()
    path.write_bytes(raw[:3000])
    with pytest.raises(InputError, match=r"0.e57 is not a whole E57 file"):
        open_sequence(tmp_path)
    monkeypatch.setitem(__import__("sys").modules, "pye57", None)
    with pytest.raises(MissingExtraError, match=r"pip install '.*\[e57\]'"):
        open_sequence(tmp_path)
