"""Packed samples are those that are drawn, as float16; turning one is turning the sensor."""

import json

import numpy as np
import pytest
from labelled_worlds import settings, write_labelled
from worlds import street

from automos.core.geometry import se3_exp
from automos.network.augmentation import Change, apply_change
from automos.network.images import make_image
from automos.network.packed import PackedSamples, pack, turned
from automos.network.recordings import Source, open_labelled
from automos.network.samples import TrainingSamples, ValidationSamples


def quiet(name: str, done: int, total: int) -> None:
    pass


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = write_labelled(street(8), tmp_path_factory.mktemp("street"))
    return open_labelled([Source(folder)], settings(), tmp_path_factory.mktemp("poses"))


def test_what_is_packed_is_what_was_drawn(recordings, tmp_path):
    drawn = TrainingSamples(recordings, settings(samples=5, use_confidence=True).network)
    pack(drawn, tmp_path, "key", 1, quiet)
    found = PackedSamples(tmp_path)
    assert len(found) == 5
    for k in range(5):
        assert set(found[k]) == {"image", "target", "confidence"}
        assert found[k]["image"].dtype == np.float32
        assert np.allclose(found[k]["image"], drawn[k]["image"], rtol=1e-3, atol=1e-3)
        assert np.array_equal(found[k]["target"], drawn[k]["target"])
    with pytest.raises(IndexError):
        found[5]


def test_neighbouring_scans_are_packed_together(recordings):
    drawn = TrainingSamples(recordings, settings(samples=16).network)
    scans = drawn._order[drawn.neighbours]
    assert scans.tolist() == sorted(scans.tolist())


def test_packing_goes_on_after_a_stop_and_begins_again_where_something_else_is_asked_for(
    recordings, tmp_path, monkeypatch
):
    monkeypatch.setattr("automos.network.packed._AT_ONCE", 2)
    drawn = ValidationSamples(recordings, settings().network)

    def stop(name: str, done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pack(drawn, tmp_path, "key", 1, stop)
    assert json.loads((tmp_path / "packed.json").read_text()) == {"key": "key", "parts": 1}
    ticks = []
    pack(drawn, tmp_path, "key", 1, lambda *tick: ticks.append(tick[1]))
    assert ticks == [4, 6, 8]
    assert all(np.array_equal(PackedSamples(tmp_path)[k]["target"], drawn[k]["target"]) for k in range(8))
    pack(drawn, tmp_path, "another", 1, lambda *tick: ticks.append(tick[1]))
    assert ticks[3:] == [2, 4, 6, 8]


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_turning_a_sample_is_turning_the_sensor(recordings, is_mirrored):
    recording = recordings[0]
    window, _ = recording.window(7, recording.read)
    rng = np.random.default_rng(0)
    width, columns = recording.view.grid.width, 37
    T = se3_exp(-2.0 * np.pi * columns / width * np.eye(6)[5])  # columns go clockwise
    if is_mirrored:
        T = np.diag([1.0, -1.0, 1.0, 1.0]) @ T
    images = [make_image(window, recording.view).channels]
    images.append(make_image(apply_change(window, Change(T), recording.view.grid, rng)[0], recording.view).channels)
    empty = np.zeros(images[0].shape[1:], np.int64)
    found = turned({"image": images[0].copy(), "target": empty}, columns, is_mirrored)["image"]
    is_close = np.isclose(found, images[1], atol=1e-2).all(axis=0)
    assert is_close.mean() > 0.97  # what lies at the edge of a pixel may fall to either side


def test_an_epoch_draws_order_and_turns_anew_and_the_same_again(recordings, tmp_path):
    network = settings(samples=12, sector=64).network
    pack(TrainingSamples(recordings, settings().network), tmp_path, "key", 1, quiet)
    samples = PackedSamples(tmp_path, network)
    assert len(samples) == 12
    assert samples[0]["image"].shape[-1] == samples[0]["target"].shape[-1] == 64
    first = [samples[k]["target"] for k in range(12)]
    samples.begin_epoch(1)
    assert any(not np.array_equal(a, samples[k]["target"]) for k, a in enumerate(first))
    samples.begin_epoch(0)
    assert all(np.array_equal(a, samples[k]["target"]) for k, a in enumerate(first))
