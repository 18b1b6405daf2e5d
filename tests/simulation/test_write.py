"""Simulated sequences on disk."""

import json

import numpy as np
import pytest

from automos import simulation
from automos.core.errors import InputError
from automos.readers import open_recordings


@pytest.fixture(scope="module")
def street():
    return simulation.simulate("canyon", "VLP-16", n_scans=3, seed=4)


@pytest.fixture(scope="module")
def written(street, tmp_path_factory):
    return simulation.write(street, tmp_path_factory.mktemp("simulated") / "street")


def test_what_is_written_is_read_back(street, written):
    recording = open_recordings(written)[0]
    assert len(recording) == 3
    assert recording.stamps == pytest.approx(street.stamps)
    assert recording.reference_poses == pytest.approx(street.reference_poses, abs=1e-9)
    for k in range(3):
        assert np.array_equal(recording[k].points, street[k].points)
        assert np.array_equal(recording[k].intensity, street[k].intensity)
        assert np.array_equal(recording.truth(k), street.truth(k))
    now = np.fromfile(written / "labels_now" / "000002.label", np.uint32)
    assert np.array_equal(now, street.truth_now(2))


def test_boxes_are_written_with_their_frame(street, written):
    found, boxes = street.boxes(1), json.loads((written / "boxes" / "000001.json").read_text())
    assert [b["id"] for b in boxes["boxes"]] == found.ids.tolist()
    assert np.array([b["center"] for b in boxes["boxes"]]) == pytest.approx(found.boxes.center, abs=1e-3)
    assert np.array(boxes["T_level_sensor"]) == pytest.approx(
        street.T_level_world @ street.reference_poses[1], abs=1e-6
    )


def test_a_run_that_was_interrupted_goes_on_where_it_stopped(street, tmp_path):
    out = simulation.write(street, tmp_path / "out")
    whole = {p.name: p.read_bytes() for p in (out / "velodyne").iterdir()}
    (out / "boxes" / "000001.json").unlink()
    (out / "velodyne" / "000001.bin").unlink()
    calls = []
    simulation.write(street, out, progress=lambda *call: calls.append(call))
    assert calls == [("simulate", 3, 3)]
    assert {p.name: p.read_bytes() for p in (out / "velodyne").iterdir()} == whole


def test_the_number_of_workers_does_not_change_the_bytes(street, written, tmp_path):
    out = simulation.write(street, tmp_path / "out", workers=2)
    for path in sorted(written.rglob("*.*")):
        assert (out / path.relative_to(written)).read_bytes() == path.read_bytes(), path.name


def test_a_folder_that_is_no_simulated_sequence_is_refused(street, tmp_path):
    (tmp_path / "photo.jpg").touch()
    with pytest.raises(InputError, match="automos did not make that folder: choose another --out"):
        simulation.write(street, tmp_path)
    with pytest.raises(InputError, match="is a file"):
        simulation.write(street, tmp_path / "photo.jpg")


def test_another_simulation_is_not_written_over(written):
    other = simulation.simulate("canyon", "VLP-16", n_scans=3, seed=5)
    with pytest.raises(InputError, match=r"written of something else \(seed: 4, not 5\)"):
        simulation.write(other, written)


def test_an_empty_folder_may_be_used(street, tmp_path):
    assert (simulation.write(street, tmp_path) / "simulation.json").exists()
