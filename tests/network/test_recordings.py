import numpy as np
import pytest
from labelled_worlds import settings, write_labelled
from worlds import street, write_bins

from automos.core.atomic import write_text
from automos.core.errors import InputError
from automos.core.label_files import pack
from automos.core.labels import Label
from automos.core.workspace import Workspace
from automos.network.recordings import LabelledRecording, ScanLabels, Shelf, Source, open_labelled
from automos.network.samples import TrainingSamples, ValidationSamples, draw_sector, measure_classes, measure_scale


@pytest.fixture(scope="module")
def world():
    return street(8)


@pytest.fixture(scope="module")
def folder(world, tmp_path_factory):
    return write_labelled(world, tmp_path_factory.mktemp("street"))


@pytest.fixture(scope="module")
def recordings(folder, tmp_path_factory):
    return open_labelled([Source(folder)], settings(), tmp_path_factory.mktemp("poses"))


def test_a_source_is_a_recording_with_or_without_results():
    assert Source.parse("a/b").results is None
    assert str(Source.parse("a/b=runs/b").results) == "runs/b"
    with pytest.raises(InputError, match="names no results folder"):
        Source.parse("a/b=")


def test_thinned_scans_keep_what_the_image_shows_with_its_labels(recordings, world):
    scan = recordings[0].read(3)
    raw, truth = world.sequence[3].points, world.truth[3]
    class_of = {tuple(point): label for point, label in zip(raw.tolist(), truth, strict=True)}
    assert 0 < len(scan.points) <= 16 * 128
    for point, c in zip(scan.points.tolist(), scan.classes, strict=True):
        assert {Label.STATIC: 1, Label.MOVING: 2}[class_of[tuple(point)]] == c


def test_a_window_looks_back_as_far_as_its_residuals(recordings):
    shelf = Shelf(recordings, 100)
    window, now = shelf.window(0, 7)
    assert np.array_equal(window.points, now.points)
    for k, points in enumerate(window.past):  # every other of ten scans a second
        assert np.array_equal(points, recordings[0].read(5 - 2 * k).points)
        # the sensor drives at 1 m/s: what was seen earlier has come 0.2 m nearer with each of them
        assert window.T_now_past[k][0, 3] == pytest.approx(-0.2 * (k + 1), abs=0.03)
    assert shelf.window(0, 0)[0].past == (None, None, None)


def test_manual_and_automatic_labels_are_read_alike(recordings, folder, world, tmp_path):
    results = tmp_path / "predictions"  # called as the folder in it
    for name in ("predictions", "confidences"):
        (results / name).mkdir(parents=True)
    for i, name in enumerate(world.sequence.names):
        pack(world.truth[i]).tofile(results / "predictions" / f"{name}.label")
        np.save(results / "confidences" / f"{name}.npy", np.full(len(world.truth[i]), 0.25, np.float32))
    write_text(results / "run.json", '{"stages": {"odometry": "0"}}')
    Workspace(results).stage("odometry", "0").save("all", recordings[0].trajectory.to_arrays())
    automatic = open_labelled([Source(folder, results)], settings(), tmp_path / "poses")[0].read(2)
    manual = recordings[0].read(2)
    assert np.array_equal(automatic.classes, manual.classes)
    assert set(automatic.confidence) == {np.float32(0.25)}
    assert set(manual.confidence) == {np.float32(1.0)}
    assert not (tmp_path / "poses").exists()  # those of the run are taken


def test_a_recording_without_labels_is_told(world, tmp_path):
    bare = write_bins(world.sequence, tmp_path / "bare")
    with pytest.raises(InputError, match="bare came without labels: label it first"):
        open_labelled([Source(bare)], settings(), tmp_path / "poses")


def test_labels_of_another_recording_are_told(folder, tmp_path):
    (tmp_path / "run" / "predictions").mkdir(parents=True)
    np.zeros(3, np.uint32).tofile(tmp_path / "run" / "predictions" / "000000.label")
    with pytest.raises(InputError, match="belongs to another scan or was cut short"):
        open_labelled([Source(folder, tmp_path / "run")], settings(), tmp_path / "poses")


def test_class_weights_come_from_the_labels_at_hand(recordings, world):
    counts = np.zeros(3)
    for i in range(len(world.sequence)):
        counts += np.bincount(recordings[0].read(i).classes, minlength=3)
    weights = measure_classes(recordings, n_scans=8)
    assert weights[0] == 0.0
    assert weights[1:] == pytest.approx(np.sqrt(counts[1:].sum() / counts[1:]))


def test_labels_without_a_moving_point_are_told_before_poses_are_found(world, tmp_path):
    still = [np.full(len(truth), Label.STATIC, np.uint8) for truth in world.truth]
    folder = write_labelled(world, tmp_path / "still", still)
    with pytest.raises(InputError, match="no moving point in the labels of still"):
        open_labelled([Source(folder)], settings(), tmp_path / "poses")
    assert not (tmp_path / "poses").exists()
    still[-1] = np.where(np.arange(len(still[-1])) == 7, Label.MOVING, Label.STATIC).astype(np.uint8)
    one_point = write_labelled(world, tmp_path / "one_point", still)
    assert len(open_labelled([Source(folder), Source(one_point)], settings(), tmp_path / "poses")) == 2


def test_epochs_draw_anew_and_equal_epochs_alike(recordings):
    one, other = (TrainingSamples(recordings, settings(samples=12).network) for _ in range(2))
    assert len(one) == 12  # of 8 scans: all of them once, then some again
    other.begin_epoch(1)
    assert not np.array_equal(one[0]["image"], other[0]["image"])
    one.begin_epoch(1)
    for i in (0, 7, 11):
        assert np.array_equal(one[i]["image"], other[i]["image"])
        assert np.array_equal(one[i]["target"], other[i]["target"])


def test_samples_hold_what_the_loss_wants(recordings):
    sample = TrainingSamples(recordings, settings(use_confidence=True).network)[0]
    assert sample["image"].shape == (5, 16, 128)
    assert sample["target"].shape == sample["confidence"].shape == (16, 128)
    assert set(np.unique(sample["target"])) == {0, 1, 2}
    assert not sample["target"][sample["image"][0] == 0].any()
    validation = ValidationSamples(recordings, settings(validation_scans=3).network)
    assert len(validation) == 3
    assert "confidence" not in validation[0]


def test_scans_without_half_of_the_past_are_left_out_unless_none_has_it(recordings):
    recording = recordings[0]  # ten scans a second, residuals 0.2, 0.4 and 0.6 s back
    assert list(recording.with_past) == list(range(3, len(recording)))
    longer = settings().network.image.model_copy(update={"residuals": 80})
    assert len(LabelledRecording(ScanLabels(recording.sequence), recording.trajectory, longer).with_past) == len(
        recording
    )


def test_the_scale_makes_channels_alike(recordings):
    mean, deviation = measure_scale(recordings)
    image = ValidationSamples(recordings, settings().network)[0]["image"]
    seen = image[:2, image[0] > 0]
    normalised = (seen - mean[:, None]) / deviation[:, None]
    assert np.abs(normalised.mean(axis=1)).max() < 0.2
    assert np.abs(normalised.std(axis=1) - 1).max() < 0.2


def test_a_sector_is_whole_columns_next_to_each_other_every_other_time_of_what_moves():
    target = np.ones((16, 128), np.int64)
    target[5, 40:44] = 2
    drawn = [draw_sector(target, 32, np.random.default_rng(seed)) for seed in range(200)]
    assert all(np.array_equal((columns - columns[0]) % 128, np.arange(32)) for columns in drawn)
    hits = np.mean([(target[:, columns] == 2).any() for columns in drawn])
    assert 0.5 < hits < 0.85  # half of them are drawn there, and a quarter of the others come by chance
    assert draw_sector(target, 0, np.random.default_rng(0)) == slice(None)
