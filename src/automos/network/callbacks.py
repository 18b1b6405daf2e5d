"""What happens beside training, step by step and epoch by epoch: networks are kept, and somebody is told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytorch_lightning as lightning

from automos.network.checkpoint import Checkpoint, save_checkpoint
from automos.network.module import MONITORED, Training


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

    def __init__(self, progress: Callable[[str, int, int], None], report: Callable[[str], object]):
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
