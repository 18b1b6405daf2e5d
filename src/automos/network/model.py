"""The network as a whole: raw image in, logits of unlabeled, static and moving out."""

from __future__ import annotations

from enum import IntEnum

import numpy.typing as npt
import torch
from torch import Tensor, nn

from automos.network.images import BASE_CHANNELS
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
