"""The network as a whole, raw image in, logits of unlabeled, static and moving out; and its file.

A trained network is one file: weights, settings and what it saw, enough to run it without anything beside it.
"""

from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy.typing as npt
import torch
from torch import Tensor, nn

from automos.core.atomic import atomic_path
from automos.core.errors import InputError
from automos.network.images import BASE_CHANNELS, FORMAT
from automos.network.salsanext import SalsaNext
from automos.settings import ImageSettings, ModelSettings


class Class(IntEnum):
    """The classes of the network."""

    UNLABELED = 0
    STATIC = 1
    MOVING = 2


class LMNet(nn.Module):
    """A backbone behind the normalisation of its input, so that a checkpoint needs nothing beside it."""

    mean: Tensor
    deviation: Tensor

    def __init__(self, image: ImageSettings, model: ModelSettings):
        super().__init__()
        inputs = len(BASE_CHANNELS) + image.residuals
        self.backbone = SalsaNext(inputs, len(Class), model.channels, model.dropout)
        self.register_buffer("mean", torch.zeros(len(BASE_CHANNELS)))
        self.register_buffer("deviation", torch.ones(len(BASE_CHANNELS)))

    def set_scale(self, mean: npt.NDArray, deviation: npt.NDArray) -> None:
        """Set the mean and the standard deviation (2,) of range and z."""
        self.mean.copy_(torch.as_tensor(mean))
        self.deviation.copy_(torch.as_tensor(deviation))

    def forward(self, image: Tensor) -> Tensor:
        """Return logits (B, 3, H, W) for images (B, 2 + K, H, W) as `make_image` gives them."""
        n = len(BASE_CHANNELS)
        is_seen = (image[:, :1] > 0.0).to(image.dtype)
        base = (image[:, :n] - self.mean[:, None, None]) / self.deviation[:, None, None]
        return self.backbone(torch.cat([base * is_seen, image[:, n:]], dim=1))


class MovingProbability(nn.Module):
    """What is deployed: images in, the probability (B, H, W) that what each pixel shows moves."""

    def __init__(self, network: LMNet):
        super().__init__()
        self.network = network

    def forward(self, image: Tensor) -> Tensor:
        """Return moving against static; a labelled answer is always wanted."""
        logits = self.network(image)
        return torch.sigmoid(logits[:, Class.MOVING] - logits[:, Class.STATIC])


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
    """Write `checkpoint`; `half` keeps 16 bits a weight, which changes hardly a label and halves the file.

    What batches had in common is kept in full: variances of a million are beyond 16 bits.
    """
    state = checkpoint.network.state_dict()
    if half:
        state |= {name: weight.detach().half() for name, weight in checkpoint.network.named_parameters()}
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
        halves = {name: value for name, value in content["state"].items() if value.dtype == torch.float16}
        network.load_state_dict(content["state"] | {name: value.float() for name, value in halves.items()})
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
