"""The training loop around LMNet: devices, precision, logs, early stop, resume, and the best network kept.

OUT/best.pt        the network with the best IoU of the moving class on the validation recordings, all that it needs
OUT/last.ckpt      where training stands; the same command goes on from it
OUT/epochs/004.pt  the network after so many epochs, for those asked for (`network.training.keep`)
OUT/log/1/metrics.csv  losses and scores by epoch, 2 after it was stopped and went on, and so forth
OUT/tensorboard/   the same, where TensorBoard is installed
"""

import csv
import importlib.util
import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy.typing as npt
import pytorch_lightning as lightning
import torch
from pytorch_lightning.callbacks import Callback, EarlyStopping, ModelCheckpoint
from pytorch_lightning.loggers import CSVLogger, TensorBoardLogger
from torch.utils.data import DataLoader

from automos.core.errors import InputError
from automos.core.parallel import available_cores
from automos.core.run import Progress, silent
from automos.network.checkpoint import Checkpoint, load_checkpoint, require_shape, save_checkpoint
from automos.network.module import MONITORED, Kept, Told, Training
from automos.network.packed import PackedSamples
from automos.network.samples import TrainingSamples, ValidationSamples
from automos.settings import NetworkSettings, TrainingSettings

_PATIENCE = 30
"""Epochs without a better validation until training stops: a fifth of the 150 that are the most."""
_AT_ONCE = 64 * 2048 * 32
"""Pixels times channels that a CPU trains on at once: one scan by the full network, which takes 2 GB."""
_MOST_LOADERS = 8
"""An H100 trains the full network on 70 scans a second, a core prepares 8 to 10; each process takes time to start."""


Samples = TrainingSamples | ValidationSamples | PackedSamples


class _Data(lightning.LightningDataModule):
    def __init__(self, train: Samples, validation: Samples, at_once: int, loaders: int):
        super().__init__()
        self._train, self._validation, self._at_once, self._loaders = train, validation, at_once, loaders

    def train_dataloader(self) -> DataLoader:
        assert self.trainer is not None
        self._train.begin_epoch(self.trainer.current_epoch)
        return self._loader(self._train)

    def val_dataloader(self) -> DataLoader:
        return self._loader(self._validation)

    def _loader(self, samples: Any) -> DataLoader:
        # Samples come in the order in which they were drawn: what is drawn depends on seed and epoch alone.
        return DataLoader(samples, self._at_once, num_workers=self._loaders)


def train_network(
    train: Samples,
    validation: Samples,
    settings: NetworkSettings,
    class_weight: npt.NDArray,
    scale: tuple[npt.NDArray, npt.NDArray],
    out: Path,
    card: dict[str, Any],
    init: Path | None = None,
    device: str = "auto",
    devices: int = 1,
    progress: Progress = silent,
    loaders: int | None = None,
    report: Callable[[str], object] = lambda sentence: None,
) -> Checkpoint:
    """Train a network, or go on where a killed run stopped; return the best, which is also in `out` / best.pt.

    Parameters
    ----------
    class_weight : (3,) weights of unlabeled (0), static, moving.
    scale : mean and standard deviation (2,) of the base channels; those of `init` are kept where it is given.
    card : what is to be known of the training data, written into the checkpoint.
    init : checkpoint to start from (fine-tuning).
    device : "gpu" trains in mixed precision; "auto" takes one if there is one, and says so if not.
    progress : called with "training" or "validation", the scans done and their total.
    loaders : processes that prepare scans; 0: the training process itself; None: `default_loaders`.
    report : called with a sentence after every epoch, and where training goes on or ends early.

    Raises
    ------
    InputError : no such device, or a checkpoint of another shape.
    """
    accelerator = choose_accelerator(device, devices)
    lightning.seed_everything(settings.training.seed, workers=True, verbose=False)
    run = Training(settings.model_dump(mode="json"), [float(w) for w in class_weight])
    run.network.set_scale(*scale)
    if init is not None:
        start = load_checkpoint(init)
        require_shape(start, settings.image, settings.model, init)
        run.network.load_state_dict(start.network.state_dict())
    best = ModelCheckpoint(out, "best-{epoch}", monitor=MONITORED, mode="max", enable_version_counter=False)
    latest = ModelCheckpoint(out, "last", enable_version_counter=False)  # of every epoch, whether it got better or not
    stop = EarlyStopping(MONITORED, mode="max", patience=_PATIENCE)
    callbacks = [best, stop, latest, Kept(out / "epochs", settings.training.keep, card), Told(progress, report)]
    at_once = settings.training.batch if accelerator == "cuda" else scans_at_once(settings)
    data = _Data(train, validation, at_once, default_loaders(accelerator, devices) if loaders is None else loaders)
    last = out / "last.ckpt"
    with _quiet():
        trainer = _make_trainer(out, accelerator, devices, settings.training, at_once, callbacks)
        if init is not None:
            start_iou = trainer.validate(run, data.val_dataloader(), verbose=False)[0][MONITORED]
            card = {**card, "iou_before": round(start_iou, 4)}
        trainer.fit(run, datamodule=data, ckpt_path=last if last.exists() else None)
    _say_if_early(stop, trainer, report)
    run.load_state_dict(torch.load(best.best_model_path, map_location="cpu", weights_only=True)["state_dict"])
    card |= {"validation_iou": round(float(best.best_model_score or 0.0), 4), "epochs": trainer.current_epoch}
    checkpoint = run.to_checkpoint({**card, "class_weight": [round(float(w), 3) for w in class_weight]})
    if trainer.is_global_zero:
        save_checkpoint(out / "best.pt", checkpoint)
    return checkpoint


def _say_if_early(stop: EarlyStopping, trainer: lightning.Trainer, report: Callable[[str], object]) -> None:
    if stop.stopped_epoch:
        report(f"stopped after {trainer.current_epoch} epochs: {_PATIENCE} brought nothing better")


def _make_trainer(
    out: Path, accelerator: str, devices: int, training: TrainingSettings, at_once: int, callbacks: list[Callback]
) -> lightning.Trainer:
    n_starts = len(list((out / "log").glob("*/metrics.csv")))  # a logger deletes what its folder holds
    loggers: list[Any] = [CSVLogger(out, name="log", version=str(n_starts + 1))]
    if importlib.util.find_spec("tensorboard"):
        loggers.append(TensorBoardLogger(out, name="", version="tensorboard"))
    return lightning.Trainer(
        accelerator=accelerator,
        devices=devices,
        strategy="ddp" if devices > 1 else "auto",
        precision=_precision(accelerator),
        max_epochs=training.epochs,
        accumulate_grad_batches=training.batch // at_once,
        logger=loggers,
        callbacks=callbacks,
        enable_progress_bar=False,
        enable_model_summary=False,
        log_every_n_steps=1,
        num_sanity_val_steps=0,
        reload_dataloaders_every_n_epochs=1,
        default_root_dir=out,
        inference_mode=False,  # else the score before fine-tuning leaves tensors that training may not change
    )


def _precision(accelerator: str) -> Literal["16-mixed", "bf16-mixed", "32-true"]:
    """Return how exactly to compute: mixed where the device is faster at it."""
    if accelerator == "cuda":
        return "16-mixed"
    return "bf16-mixed" if torch.ops.mkldnn._is_mkldnn_bf16_supported() else "32-true"


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Lightning's notes on hardware, on its own code and its advertisements from the user's terminal."""
    for name in ("pytorch_lightning", "lightning_fabric"):
        logging.getLogger(name).setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="pytorch_lightning")
        yield


def choose_accelerator(device: str, devices: int = 1) -> str:
    """Return Lightning's name of the device.

    Raises
    ------
    InputError : a GPU was asked for and there is none, or fewer than `devices`, or a device of another name.
    """
    if device not in ("auto", "cpu", "gpu"):
        raise InputError(f"there is no device '{device}': choose auto, cpu or gpu")
    if torch.cuda.is_available() and device != "cpu":
        if (found := torch.cuda.device_count()) < devices:
            raise InputError(f"{devices} GPUs were asked for, {found} found: use --devices {found}")
        return "cuda"
    if device == "gpu":
        raise InputError("no GPU was found, but one was asked for: check the driver (nvidia-smi), or use --device cpu")
    return "cpu"


def scans_at_once(settings: NetworkSettings) -> int:
    """Return how many of the scans of a step a CPU trains on at once: `_AT_ONCE`, and a whole number of times a step.

    The gradient of a step is the mean of theirs, so memory does not grow with the step.
    """
    width = settings.training.sector or settings.image.width
    most = _AT_ONCE // (settings.image.height * min(width, settings.image.width) * settings.model.channels)
    batch = settings.training.batch
    return max(n for n in range(1, batch + 1) if batch % n == 0 and n <= max(most, 1))


def default_loaders(accelerator: str, devices: int) -> int:
    """Return how many processes prepare scans beside each GPU, which would wait for a single one; none on a CPU."""
    return min(available_cores() // devices, _MOST_LOADERS) if accelerator == "cuda" else 0


def read_curve(out: Path) -> list[dict[str, float]]:
    """Return one row an epoch of what a training logged in all its starts, e.g. epoch and val_iou_moving."""
    rows: dict[int, dict[str, float]] = {}
    for path in sorted((out / "log").glob("*/metrics.csv"), key=lambda path: int(path.parent.name)):
        with path.open() as file:
            for line in csv.DictReader(file):
                row = rows.setdefault(int(line["epoch"]), {})
                row.update({name: float(value) for name, value in line.items() if value})
    return [rows[epoch] for epoch in sorted(rows)]
