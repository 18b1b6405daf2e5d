"""A trained network in one file: weights, settings and what it saw, enough to run it without anything beside it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from automos.core.atomic import atomic_path
from automos.core.errors import InputError
from automos.network.images import FORMAT
from automos.network.model import LMNet
from automos.settings import ImageSettings, ModelSettings


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A network with what it needs to be run or trained on.

    Attributes
    ----------
    network : LMNet
        In evaluation mode.
    image, model : ImageSettings and ModelSettings
        Its settings.
    card : dict of str to Any
        What it was trained on and how it scored, plain values.
    """

    network: LMNet
    image: ImageSettings
    model: ModelSettings
    card: dict[str, Any] = field(default_factory=dict)


def save_checkpoint(path: Path, checkpoint: Checkpoint, half: bool = False) -> None:
    """Write `checkpoint`; `half` keeps 16 bits a weight, which changes hardly a label and halves the file."""
    state = {
        name: value.half() if half and value.is_floating_point() and name not in ("mean", "deviation") else value
        for name, value in checkpoint.network.state_dict().items()
    }
    content = {
        "format": FORMAT,
        "image": checkpoint.image.model_dump(mode="json"),
        "model": checkpoint.model.model_dump(mode="json"),
        "card": checkpoint.card,
        "state": state,
    }
    with atomic_path(path) as temporary:
        torch.save(content, temporary)


def load_checkpoint(path: Path) -> Checkpoint:
    """Return the network in `path`.

    Raises
    ------
    InputError : no such file, not a checkpoint, or weights that are no numbers or do not fit the network it names.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist: give a checkpoint that automos train wrote (best.pt)")
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
        version = content["format"]
    except Exception as error:  # torch raises what its readers raise: pickle's, zip's and its own errors
        why = type(error).__name__
        raise InputError(f"{path} is not a checkpoint of automos train ({why}): give best.pt") from None
    if version != FORMAT:
        raise InputError(f"{path} is a checkpoint of format {version}, this version reads {FORMAT}: train again")
    try:
        image, model = ImageSettings(**content["image"]), ModelSettings(**content["model"])
        network = LMNet(image, model)
        network.load_state_dict({name: _full(value) for name, value in content["state"].items()})
        card = dict(content.get("card", {}))
    except (ValueError, RuntimeError, KeyError, TypeError, AttributeError):  # pydantic's are ValueErrors
        raise InputError(f"{path} holds weights that do not fit the network it names: train again") from None
    if not all(value.isfinite().all() for value in network.state_dict().values()):
        raise InputError(f"{path} holds weights that are no numbers: train again")
    return Checkpoint(network.eval(), image, model, card)


def require_shape(checkpoint: Checkpoint, image: ImageSettings, model: ModelSettings, path: Path) -> None:
    """Raise unless training with these settings can start from `checkpoint`.

    Image sizes may differ, the network runs on any; architecture, channels and residual images may not.
    """
    pairs = {
        "network.model.channels": (checkpoint.model.channels, model.channels),
        "network.image.residuals": (checkpoint.image.residuals, image.residuals),
    }
    for setting, (found, wanted) in pairs.items():
        if found != wanted:
            raise InputError(f"{path} has {setting} = {found}, not {wanted}: set {setting}={found} or drop --init")


def _full(value: torch.Tensor) -> torch.Tensor:
    return value.float() if value.dtype == torch.float16 else value
