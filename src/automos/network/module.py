"""LMNet as PyTorch Lightning trains it: loss, optimiser, and the IoU of the moving class by which the best is kept."""

from __future__ import annotations

import math
import time
from typing import Any

import pytorch_lightning as lightning
import torch
from torch import Tensor
from torchmetrics.classification import MulticlassConfusionMatrix

from automos.network.checkpoint import Checkpoint
from automos.network.losses import segmentation_loss
from automos.network.model import Class, LMNet
from automos.settings import NetworkSettings

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
