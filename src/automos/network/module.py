"""LMNet as PyTorch Lightning trains it: loss, optimiser, and the IoU of the moving class by which the best is kept.

The loss is weighted negative log-likelihood and Lovász-softmax (Berman et al., CVPR 2018), unlabeled ignored. Beside
training, step by step and epoch by epoch, networks are kept, and somebody is told.
"""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytorch_lightning as lightning
import torch
from torch import Tensor
from torchmetrics.classification import MulticlassConfusionMatrix

from automos.core.run import Progress
from automos.network.checkpoint import Checkpoint, Class, LMNet, save_checkpoint
from automos.settings import NetworkSettings


def segmentation_loss(logits: Tensor, target: Tensor, class_weight: Tensor, confidence: Tensor | None = None) -> Tensor:
    """Return the scalar loss of a batch.

    Parameters
    ----------
    logits : (B, 3, H, W).
    target : (B, H, W) int64 of `Class`; UNLABELED pixels do not count.
    class_weight : (3,), 0 for UNLABELED.
    confidence : (B, H, W) in [0, 1], weight of each pixel in the likelihood; 1 everywhere where not given.
    """
    log_probability = torch.log_softmax(logits.float(), dim=1)
    weight = class_weight[target]  # (B, H, W)
    if confidence is not None:
        weight = weight * confidence
    picked = log_probability.gather(1, target[:, None])[:, 0]
    likelihood = -(weight * picked).sum() / weight.sum().clamp(min=1e-8)
    return likelihood + lovasz_softmax(log_probability.exp(), target)


def lovasz_softmax(probability: Tensor, target: Tensor) -> Tensor:
    """Return the mean over the classes present of the Lovász extension of 1 - IoU.

    Parameters
    ----------
    probability : (B, C, H, W).
    target : (B, H, W) int64; pixels of class 0 are left out, and class 0 is none of those scored.
    """
    is_labelled = target.reshape(-1) > Class.UNLABELED
    flat = probability.movedim(1, -1).reshape(-1, probability.shape[1])[is_labelled]
    truth = target.reshape(-1)[is_labelled]
    losses = []
    for c in range(1, probability.shape[1]):
        is_class = (truth == c).to(flat.dtype)
        if is_class.any():
            errors, order = (is_class - flat[:, c]).abs().sort(descending=True)
            losses.append(errors @ _jaccard_steps(is_class[order]))
    return torch.stack(losses).mean() if losses else probability.sum() * 0.0


def _jaccard_steps(is_class: Tensor) -> Tensor:
    """Return how much the Jaccard loss grows as pixels become wrong one after the other, worst first."""
    total = is_class.sum()
    intersection = total - is_class.cumsum(0)
    union = total + (1.0 - is_class).cumsum(0)
    loss = 1.0 - intersection / union
    return torch.cat([loss[:1], loss[1:] - loss[:-1]])


MONITORED = "val_iou_moving"

_LEARNING_RATE = {"adamw": 0.002, "paper": 0.01}
_WARM_UP = 1.0
"""Epochs until the learning rate is at its highest (LMNet)."""
_MOMENTUM, _DECAY = 0.9, 0.99
"""Of the paper's SGD; `_DECAY` is the rate's, per epoch."""
_WEIGHT_DECAY = 1e-4
"""LMNet's, for both recipes."""


class Training(lightning.LightningModule):
    """One training run."""

    class_weight: Tensor

    def __init__(self, settings: dict[str, Any], class_weight: list[float]):
        """Take `NetworkSettings` as plain values and the (3,) weights of the classes."""
        super().__init__()
        self.save_hyperparameters()
        self.settings = NetworkSettings(**settings)
        self.network = LMNet(self.settings.image, self.settings.model)
        self.register_buffer("class_weight", torch.tensor(class_weight), persistent=False)
        self.confusion = MulticlassConfusionMatrix(len(Class), ignore_index=int(Class.UNLABELED))

    def on_train_epoch_start(self) -> None:
        """Look at the clock: the first epoch after an interruption is timed like any other."""
        self._started = time.perf_counter()

    def on_train_epoch_end(self) -> None:
        """Log the seconds that the epoch took, validation included."""
        self.log("seconds", time.perf_counter() - self._started)

    def training_step(self, batch: dict[str, Tensor], index: int) -> Tensor:
        """Return the loss of a batch of `image`, `target` and `confidence`."""
        loss = segmentation_loss(
            self.network(batch["image"]), batch["target"], self.class_weight, batch.get("confidence")
        )
        self.log("train_loss", loss, prog_bar=True, on_step=False, on_epoch=True, sync_dist=True)
        return loss

    def validation_step(self, batch: dict[str, Tensor], index: int) -> None:
        """Count a batch: moving against static in every labelled pixel."""
        logits = self.network(batch["image"])
        is_moving = logits[:, Class.MOVING] > logits[:, Class.STATIC]
        self.confusion.update(torch.where(is_moving, int(Class.MOVING), int(Class.STATIC)), batch["target"])

    def on_validation_epoch_end(self) -> None:
        """Log the scores over all pixels of all validation scans, pooled."""
        counts = self.confusion.compute().double()  # rows: truth
        self.confusion.reset()
        hits = counts[Class.MOVING, Class.MOVING]
        found, true = counts[:, Class.MOVING].sum(), counts[Class.MOVING].sum()
        scores = {
            MONITORED: hits / (found + true - hits).clamp(min=1.0),
            "val_precision": hits / found.clamp(min=1.0),
            "val_recall": hits / true.clamp(min=1.0),
        }
        for name, value in scores.items():
            self.log(name, value.float(), prog_bar=name == MONITORED)

    def configure_optimizers(self) -> Any:
        """Return the optimiser and the schedule of its rate, step by step."""
        s = self.settings.training
        rate = s.learning_rate or _LEARNING_RATE[s.recipe]
        if s.recipe == "paper":
            optimizer: torch.optim.Optimizer = torch.optim.SGD(
                self.parameters(), rate, _MOMENTUM, weight_decay=_WEIGHT_DECAY
            )
        else:
            optimizer = torch.optim.AdamW(self.parameters(), rate, weight_decay=_WEIGHT_DECAY)
        steps = max(int(self.trainer.estimated_stepping_batches) / s.epochs, 1.0)  # an epoch's
        scheduler = torch.optim.lr_scheduler.LambdaLR(optimizer, lambda step: self._rate(step / steps))
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": scheduler, "interval": "step"}}

    def _rate(self, epoch: float) -> float:
        """Return the share of the highest learning rate, `epoch` epochs into the training."""
        s = self.settings.training
        if epoch < _WARM_UP:
            return (epoch + 1e-3) / _WARM_UP
        if s.recipe == "paper":
            return _DECAY ** (epoch - _WARM_UP)
        share = (epoch - _WARM_UP) / max(s.epochs - _WARM_UP, 1e-9)
        return 0.5 * (1.0 + math.cos(math.pi * min(share, 1.0)))

    def to_checkpoint(self, card: dict[str, Any]) -> Checkpoint:
        """Return the network as it is now, ready to be deployed."""
        return Checkpoint(self.network.eval(), self.settings.image, self.settings.model, card)


class Kept(lightning.Callback):
    """Keeps the network as it is after each of some numbers of epochs."""

    def __init__(self, folder: Path, epochs: tuple[int, ...], card: dict[str, Any]):
        self._folder, self._epochs, self._card = folder, epochs, card

    def on_train_epoch_end(self, trainer: lightning.Trainer, module: lightning.LightningModule) -> None:
        """Keep it, if it is asked for."""
        done = trainer.current_epoch + 1
        if done in self._epochs and trainer.is_global_zero:
            assert isinstance(module, Training)
            self._folder.mkdir(exist_ok=True)
            content = Checkpoint(module.network, module.settings.image, module.settings.model, self._card)
            save_checkpoint(self._folder / f"{done:03d}.pt", content)


class Told(lightning.Callback):
    """Says how many scans were trained on, out of how many, and how each epoch went."""

    def __init__(self, progress: Progress, report: Callable[[str], object]):
        self._progress, self._report = progress, report

    def on_train_start(self, trainer: lightning.Trainer, module: lightning.LightningModule) -> None:
        """Say where training goes on."""
        if trainer.current_epoch:
            self._report(f"going on after epoch {trainer.current_epoch}")

    def on_train_batch_end(self, trainer: lightning.Trainer, *others: Any) -> None:
        """Say how far it is."""
        scans = len(trainer.train_dataloader.dataset)
        done = min((others[-1] + 1) * trainer.train_dataloader.batch_size, scans)
        self._progress("training", trainer.current_epoch * scans + done, (trainer.max_epochs or 1) * scans)

    def on_validation_batch_end(self, trainer: lightning.Trainer, *others: Any) -> None:
        """Say how far it is."""
        self._progress("validation", others[3] + 1, int(sum(trainer.num_val_batches)))

    def on_train_epoch_end(self, trainer: lightning.Trainer, module: lightning.LightningModule) -> None:
        """Say how the epoch went."""
        found = trainer.callback_metrics
        if trainer.is_global_zero:
            self._report(
                f"epoch {trainer.current_epoch + 1} of at most {trainer.max_epochs}: loss {found['train_loss']:.4f}, "
                f"IoU of the moving class {100 * found[MONITORED]:.1f} % on validation"
            )
