"""`automos train`: recordings and labels in, a checkpoint out."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from automos.core.atomic import write_text
from automos.core.claims import TRAINING, claim
from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.run import Progress, silent
from automos.core.stages import fingerprint
from automos.network.packed import PackedSamples, pack
from automos.network.recordings import LabelledRecording, Source, open_labelled
from automos.network.samples import TrainingSamples, ValidationSamples, measure_classes, measure_scale
from automos.settings import Settings, dump_yaml

if TYPE_CHECKING:
    from automos.network.checkpoint import Checkpoint

Recordings = list[LabelledRecording]
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class TrainingData:
    """What a network is trained on and chosen by; without `validation`, the last recording is kept for it."""

    train: tuple[Source, ...]
    validation: tuple[Source, ...] = ()


def train(
    data: TrainingData,
    out: Path,
    settings: Settings,
    init: Path | None = None,
    device: str = "auto",
    devices: int = 1,
    progress: Progress = silent,
    poses: Path | None = None,
    loaders: int | None = None,
    report: Callable[[str], object] = lambda sentence: None,
) -> Checkpoint:
    """Train LMNet on `data` into folder `out`, or go on where a killed run stopped; return the best network.

    `out` / best.pt is the network with all that is needed to run it. `init` fine-tunes a checkpoint. Poses which no
    results folder holds are estimated once into `poses` (`out` / poses where not given). `loaders` processes prepare
    scans; 0: the training process itself; None: up to 8 beside a GPU, 0 on a CPU. `report` is told how it goes.

    Raises
    ------
    InputError : recordings without labels, a class that no label has, another architecture in `init`, no such device,
        or an `out` that holds another training.
    MissingExtraError : PyTorch or Lightning is not installed.
    """
    require_training()
    from automos.network.checkpoint import load_checkpoint, require_shape
    from automos.network.training import train_network

    claim(out, TRAINING)
    _claim(out, data, settings, init)
    network = settings.network
    if init is not None:  # before poses, which take far longer
        require_shape(load_checkpoint(init), network.image, network.model, init)
    recordings = open_labelled(data.train, settings, poses or out / "poses", progress)
    weights = measure_classes(recordings, progress)
    if data.validation:
        validation = open_labelled(data.validation, settings, poses or out / "poses", progress)
    else:
        recordings, validation = _split(recordings)
        measure_classes(validation, progress)  # raises where nothing moves by which an epoch could be chosen
    card = {
        "trained_on": [recording.sequence.name for recording in recordings],
        "scans": sum(len(recording) for recording in recordings),
        "labels": sorted({"automatic" if source.results else "given" for source in data.train}),
        "started_from": init.name if init else "scratch",
    }
    samples, held_out = _samples(recordings, validation, settings, out, progress)
    scale, rest = measure_scale(recordings, progress), (card, init, device, devices, progress, loaders, report)
    return train_network(samples, held_out, network, weights, scale, out, *rest)


def _samples(
    recordings: Recordings, validation: Recordings, settings: Settings, out: Path, progress: Progress
) -> tuple[TrainingSamples, ValidationSamples] | tuple[PackedSamples, PackedSamples]:
    """Return what is trained on and what the epoch is chosen by, packed in `out` if that is asked for."""
    network, training = settings.network, settings.network.training
    held_out = ValidationSamples(validation, network)
    if not training.packed:
        return TrainingSamples(recordings, network), held_out
    drawn = {"training": training.model_copy(update={"samples": training.packed, "sector": 0})}
    whole = TrainingSamples(recordings, network.model_copy(update=drawn))
    sequences = [recording.sequence.fingerprint() for recording in (*recordings, *validation)]
    key = fingerprint(sequences, drawn["training"].model_dump(mode="json"), network.image.model_dump(mode="json"))
    pack(whole, out / "packed", key, 0, progress)
    pack(held_out, out / "packed_validation", key, 0, progress)
    return PackedSamples(out / "packed", network), PackedSamples(out / "packed_validation")


def device_note(device: str) -> str:
    """Return in a sentence what will be trained on.

    Raises
    ------
    InputError : no such device.
    """
    require_training()
    from automos.network.training import choose_accelerator

    if choose_accelerator(device) != "cpu":
        return "training on the GPU, in mixed precision"
    return "training on the CPU" + ("; no GPU was found, so this takes its time" if device == "auto" else "")


def require_training() -> None:
    """Raise MissingExtraError unless PyTorch, Lightning and torchmetrics are installed."""
    for package in ("torch", "pytorch_lightning", "torchmetrics"):
        import_extra(package, "train", "training needs {}, which is not installed: {}")


def _claim(out: Path, data: TrainingData, settings: Settings, init: Path | None) -> None:
    """Keep the settings in `out`; raise where it holds a training of other data or settings."""
    mark = f"# {fingerprint(str(data), settings.network.model_dump(mode='json'), str(init))}\n"
    path = out / "settings.yaml"
    if path.exists() and not path.read_text().startswith(mark) and (out / "last.ckpt").exists():
        raise InputError(f"{out} holds a training on other data or with other settings: choose another --out")
    write_text(path, mark + dump_yaml(settings))


def _split(recordings: Recordings) -> tuple[Recordings, Recordings]:
    """Return the recordings to train on and those to choose the epoch by: the last of several, else the same one."""
    if len(recordings) == 1:
        _log.warning("one recording only: the best epoch is chosen by the scans that were trained on")
        return recordings, recordings
    return recordings[:-1], recordings[-1:]
