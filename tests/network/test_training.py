"""Training as a user runs it, on a street of eight scans, and one recording learnt by heart (slow)."""

import subprocess
import sys
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from labelled_worlds import settings, write_labelled
from worlds import street

torch = pytest.importorskip("torch", reason="the network needs PyTorch: pip install '.[train]'")
pytest.importorskip("pytorch_lightning", reason="training needs Lightning: pip install '.[train]'")
pytest.importorskip("torchmetrics", reason="training needs torchmetrics: pip install '.[train]'")

from pytorch_lightning.callbacks import EarlyStopping  # noqa: E402

from automos.core.errors import InputError  # noqa: E402
from automos.evaluation.moving import Counts, count  # noqa: E402
from automos.network.checkpoint import load_checkpoint  # noqa: E402
from automos.network.deployed import load_network  # noqa: E402
from automos.network.module import Told, Training, segmentation_loss  # noqa: E402
from automos.network.online import OnlineSegmenter  # noqa: E402
from automos.network.recordings import Source  # noqa: E402
from automos.network.train import TrainingData, train  # noqa: E402
from automos.network.training import choose_accelerator, default_loaders, read_curve, scans_at_once  # noqa: E402
from automos.settings import load_settings  # noqa: E402
from automos.simulation import simulate, write  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning", "ignore::FutureWarning")


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> TrainingData:
    return TrainingData((Source(write_labelled(street(8), tmp_path_factory.mktemp("street"))),))


@pytest.fixture(scope="module")
def trained(data, tmp_path_factory):
    out = tmp_path_factory.mktemp("network")
    train(data, out, settings(), device="cpu")
    return out


def test_one_step_goes_down_the_gradient_of_the_loss():
    network = settings(learning_rate=0.1).network
    torch.manual_seed(0)
    run = Training(network.model_dump(mode="json"), [0.0, 1.0, 5.0]).train()
    batch = {"image": torch.rand(2, 5, 16, 128) * 10, "target": torch.randint(0, 3, (2, 16, 128))}
    run.log = lambda *arguments, **options: None
    torch.manual_seed(1)  # the same channels are dropped
    loss = run.training_step(batch, 0)
    torch.manual_seed(1)
    wanted = segmentation_loss(run.network(batch["image"]), batch["target"], torch.tensor([0.0, 1.0, 5.0]))
    assert loss.item() == pytest.approx(wanted.item(), rel=1e-4)
    loss.backward()
    parameter = next(p for p in run.network.parameters() if p.grad.abs().sum() > 0)
    before, gradient = parameter.detach().clone(), parameter.grad.clone()
    torch.optim.SGD(run.parameters(), network.training.learning_rate).step()
    assert torch.allclose(parameter, before - 0.1 * gradient)


def test_a_training_leaves_a_checkpoint_and_its_curve(trained, data):
    checkpoint = load_checkpoint(trained / "best.pt")
    assert checkpoint.image == settings().network.image
    assert checkpoint.card["trained_on"] == [data.train[0].recording.name]
    assert checkpoint.card["labels"] == ["given"]
    curve = read_curve(trained)
    assert [row["epoch"] for row in curve] == [0.0, 1.0]
    assert all(np.isfinite(row["train_loss"]) for row in curve)
    assert checkpoint.card["validation_iou"] == pytest.approx(max(row["val_iou_moving"] for row in curve), abs=1e-3)


def test_a_training_goes_on_where_it_was_stopped(data, trained, tmp_path):
    class KilledError(Exception):
        pass

    out = tmp_path / "network"
    with pytest.MonkeyPatch.context() as patch:
        from automos.network.samples import TrainingSamples

        begin = TrainingSamples.begin_epoch

        def stop_before_the_second(self: TrainingSamples, epoch: int) -> None:
            if epoch == 1:
                raise KilledError
            begin(self, epoch)

        patch.setattr(TrainingSamples, "begin_epoch", stop_before_the_second)
        with pytest.raises(KilledError):
            train(data, out, settings(), device="cpu")
    assert not (out / "best.pt").exists()
    resumed = train(data, out, settings(), device="cpu")
    whole = load_checkpoint(trained / "best.pt")
    assert resumed.card["epochs"] == whole.card["epochs"] == 2
    before, after = read_curve(out), read_curve(trained)  # epochs before the stop and after it, as if in one go
    assert [row["epoch"] for row in before] == [row["epoch"] for row in after] == [0.0, 1.0]
    assert all(row["seconds"] > 0.0 for row in before)
    assert [row["val_iou_moving"] for row in before] == pytest.approx(
        [row["val_iou_moving"] for row in after], abs=1e-3
    )
    for a, b in zip(resumed.network.parameters(), whole.network.parameters(), strict=True):
        assert torch.allclose(a, b, atol=1e-4)


def test_a_folder_of_another_training_is_not_gone_on_with(trained, data):
    with pytest.raises(InputError, match="holds a training on other data or with other settings"):
        train(data, trained, settings(epochs=5), device="cpu")


def test_fine_tuning_starts_from_a_checkpoint_of_the_same_shape_and_keeps_the_epochs_asked_for(trained, data, tmp_path):
    tuned = train(data, tmp_path / "tuned", settings(epochs=1, keep=(1, 3)), init=trained / "best.pt", device="cpu")
    assert tuned.card["started_from"] == "best.pt"
    assert 0.0 <= tuned.card["iou_before"] <= 1.0
    assert torch.equal(tuned.network.mean, load_checkpoint(trained / "best.pt").network.mean)
    kept = load_checkpoint(tmp_path / "tuned" / "epochs" / "001.pt")  # the third epoch never came
    assert [path.name for path in (tmp_path / "tuned" / "epochs").iterdir()] == ["001.pt"]
    assert all(torch.equal(a, b) for a, b in zip(kept.network.parameters(), tuned.network.parameters(), strict=True))
    wider = settings().model_copy(
        update={"network": settings().network.model_copy(update={"model": settings().network.model.model_copy(
            update={"channels": 8}
        )})}
    )  # fmt: skip
    with pytest.raises(InputError, match=r"network.model.channels = 4, not 8"):
        train(data, tmp_path / "wider", wider, init=trained / "best.pt", device="cpu")


def test_a_device_that_is_none_is_told(data, tmp_path):
    with pytest.raises(InputError, match="there is no device 'tpu'"):
        train(data, tmp_path / "network", settings(), device="tpu")


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU here")
def test_a_gpu_that_is_not_there_is_told(data, tmp_path):
    with pytest.raises(InputError, match="no GPU was found"):
        train(data, tmp_path / "network", settings(), device="gpu")


@pytest.mark.parametrize(
    ("changed", "scans"),
    [
        ({}, 1),  # 64 x 2048 pixels, 32 channels: all that is allowed
        ({"network.model.channels": 8}, 4),  # a quarter of them each
        ({"network.training.sector": 256}, 8),  # an eighth
        ({"network.model.channels": 8, "network.training.batch": 6}, 3),  # 4 would leave a part of a step
        ({"network.image.width": 4096}, 1),
    ],
)
def test_a_cpu_trains_on_as_many_scans_at_once_as_memory_is_meant_for(changed, scans):
    assert scans_at_once(load_settings("default", overrides=changed).network) == scans


def test_training_says_how_far_it_is_how_epochs_went_where_it_goes_on_and_that_it_ends_early(data, tmp_path):
    ticks, said = [], []
    tell = {"progress": lambda *tick: ticks.append(tick), "report": said.append}
    train(data, tmp_path, settings(epochs=2), device="cpu", **tell)
    assert {("labels", 8, 8), ("channels", 8, 8), ("training", 2, 10), ("training", 10, 10)} <= set(ticks)
    assert [tick for tick in ticks if tick[0] == "validation"]
    assert [sentence.split(":")[0] for sentence in said] == ["epoch 1 of at most 2", "epoch 2 of at most 2"]
    with pytest.MonkeyPatch.context() as patch:
        never = partial(EarlyStopping, min_delta=2.0)  # better by more than an IoU can be
        patch.setattr("automos.network.training.EarlyStopping", never)
        patch.setattr("automos.network.training._PATIENCE", 1)
        train(data, tmp_path / "still", settings(epochs=9), device="cpu", **tell)
    assert said[-1] == "stopped after 2 epochs: 1 brought nothing better"


def test_training_that_goes_on_says_from_where():
    said = []
    Told(lambda *tick: None, said.append).on_train_start(SimpleNamespace(current_epoch=3), None)
    Told(lambda *tick: None, said.append).on_train_start(SimpleNamespace(current_epoch=0), None)
    assert said == ["going on after epoch 3"]


def test_cores_prepare_scans_beside_a_gpu_and_none_where_all_of_them_train(monkeypatch):
    monkeypatch.setattr("automos.network.training.available_cores", lambda: 16)
    assert default_loaders("cuda", 1) == 8
    assert default_loaders("cuda", 4) == 4
    assert default_loaders("cpu", 1) == 0


def test_fewer_gpus_than_asked_for_are_told(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    assert choose_accelerator("auto") == "cuda"
    with pytest.raises(InputError, match="2 GPUs were asked for, 1 found: use --devices 1"):
        choose_accelerator("gpu", 2)


@pytest.mark.slow
def test_two_processes_train_one_network(data, tmp_path):
    """DDP as on two GPUs, on two processes of the CPU: every process starts the command again."""
    sizes = ("image.height=16", "image.width=64", "image.residuals=2", "model.channels=4")
    lengths = ("training.epochs=1", "training.batch=2")
    options = [word for value in (*sizes, *lengths) for word in ("--set", f"network.{value}")]
    script = tmp_path / "run.py"
    script.write_text("from automos.cli import main\nif __name__ == '__main__':\n    main()\n")
    command = [sys.executable, script, "train", "--data", data.train[0].recording]
    device = ["--device", "cpu", "--devices", "2", "--out", tmp_path / "net"]
    subprocess.run([*command, *device, *options], check=True, timeout=300)
    assert load_checkpoint(tmp_path / "net" / "best.pt").card["epochs"] == 1
    steps = [row["step"] for row in read_curve(tmp_path / "net")]
    assert steps == [1.0]  # eight scans, two a step and process: two steps, not four


@pytest.mark.slow
def test_one_recording_is_learnt_by_heart(tmp_path):
    """IoU > 90 on the points of the training recording, by the online segmenter: narrow network, 64 x 512."""
    sequence = simulate("city", "HDL-64E", n_scans=16, seed=31, compensated=True)
    folder = write(sequence, tmp_path / "city")
    narrow = settings(epochs=60, samples=48, batch=4, learning_rate=0.004, augment=False, validation_scans=16)
    chosen = narrow.model_copy(
        update={
            "network": narrow.network.model_copy(
                update={
                    "image": narrow.network.image.model_copy(update={"height": 64, "width": 512, "residuals": 8}),
                    "model": narrow.network.model.model_copy(update={"channels": 8, "dropout": 0.0}),
                }
            )
        }
    )
    train(TrainingData((Source(folder),)), tmp_path / "network", chosen, device="cpu")
    segmenter = OnlineSegmenter(load_network(tmp_path / "network" / "best.pt"), chosen)
    counts = sum((count(segmenter.step(sequence[i]), sequence.truth(i)) for i in range(len(sequence))), Counts())
    assert counts.scores.iou > 0.9


def test_where_training_stands_is_kept_though_it_got_no_better(data, tmp_path):
    train(data, tmp_path, settings(epochs=3, learning_rate=1e-6), device="cpu")
    assert len({row["val_iou_moving"] for row in read_curve(tmp_path)}) < 3
    assert torch.load(tmp_path / "last.ckpt", map_location="cpu", weights_only=False)["epoch"] == 2


def test_a_training_may_pack_its_samples_first_and_goes_on_from_them(data, tmp_path):
    ticks = []
    packed = settings(packed=12, samples=6, sector=64)
    best = train(data, tmp_path, packed, device="cpu", progress=lambda *tick: ticks.append(tick))
    assert {("packed", 12, 12), ("packed_validation", 5, 5), ("training", 12, 12)} <= set(ticks)
    assert np.load(tmp_path / "packed" / "image.npy", mmap_mode="r").shape == (12, 5, 16, 128)
    assert best.card["epochs"] == 2
    ticks.clear()
    train(data, tmp_path, packed, device="cpu", progress=lambda *tick: ticks.append(tick))
    assert not [tick for tick in ticks if tick[0].startswith("packed")]
