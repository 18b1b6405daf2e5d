"""Packed samples are those that are drawn, as float16; mirroring one is mirroring the world."""

import json

import numpy as np
import pytest
from labelled_worlds import settings, write_labelled
from worlds import street

from automos.network.augmentation import Change, apply_change
from automos.network.images import make_image
from automos.network.packed import PackedSamples, pack
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
    assert ticks == [4, 5]
    assert all(np.array_equal(PackedSamples(tmp_path)[k]["target"], drawn[k]["target"]) for k in range(5))
    pack(drawn, tmp_path, "another", 1, lambda *tick: ticks.append(tick[1]))
    assert ticks[2:] == [2, 4, 5]


def test_samples_are_mirrored_as_worlds_are_in_some_epochs(recordings, tmp_path):
    recording = recordings[0]
    pack(ValidationSamples(recordings, settings().network), tmp_path, "key", 1, quiet)
    samples = PackedSamples(tmp_path, settings().network)
    window, _ = recording.window(7, recording.read)
    mirror = Change(np.diag([1.0, -1.0, 1.0, 1.0]))
    mirrored, _ = apply_change(window, mirror, recording.grid, np.random.default_rng(0))
    wanted = [make_image(each, recording.grid).channels for each in (window, mirrored)]
    found = set()
    for epoch in range(12):
        samples.begin_epoch(epoch)
        image = samples[int(np.flatnonzero(samples._order == 4)[0])]["image"]
        # what lies at the edge of a pixel may fall to either side
        alike = [np.isclose(image, each, atol=1e-2).all(axis=0).mean() > 0.97 for each in wanted]
        assert sum(alike) == 1
        found.add(alike.index(True))
    assert found == {0, 1}


def test_an_epoch_draws_order_and_sides_anew_and_the_same_again(recordings, tmp_path):
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
