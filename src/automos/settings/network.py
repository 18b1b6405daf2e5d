"""III-E: LMNet: its images, its model and its training."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class ImageSettings(Group):
    """III-E: the range image that the network sees."""

    height: int = Field(
        64, ge=16, multiple_of=16, description="rows; a sensor's beams are shared out among them; more take longer"
    )
    width: int = Field(2048, ge=16, multiple_of=16, description="columns; more show smaller things and take longer")
    residuals: int = Field(
        8, ge=0, description="residual images, one each for as many fifths of a second; more show slower motion"
    )


class ModelSettings(Group):
    """The network's shape."""

    name: Literal["salsanext", "rangenet"] = "salsanext"
    channels: int = Field(
        32,
        ge=4,
        multiple_of=4,
        description="of the first layer; 32 is full size, 8 narrow; more learn more, and slower",
    )
    dropout: float = Field(
        0.2, ge=0, lt=1, description="share of channels left out while training; more reduces overfitting"
    )


class TrainingSettings(Group):
    """Training of the network."""

    recipe: Literal["adamw", "paper"] = Field(
        "adamw",
        description="AdamW with a cosine; paper: SGD that decays by a hundredth an epoch, which needs more epochs",
    )
    learning_rate: float | None = Field(
        None, gt=0, description="at its highest; none: the recipe's (0.002, paper 0.01); a higher one forgets more"
    )
    epochs: int = Field(150, ge=1, description="at most; more take longer and cost nothing else: the best is kept")
    samples: int = Field(0, ge=0, description="scans per epoch, drawn again each time; 0: every scan once")
    sector: int = Field(
        0, ge=0, multiple_of=16, description="columns of an image that are trained on; 0: all; fewer make cheaper steps"
    )
    batch: int = Field(8, ge=1, description="scans a step and device; more take more memory and make fewer steps")
    augment: bool = Field(True, description="turn, mirror, shift and thin scans; without, few scans are overfitted")
    use_confidence: bool = Field(False, description="weight every point's loss by the confidence of its label")
    validation_scans: int = Field(
        100, ge=1, description="scans an epoch is judged by, evenly spread; more judge better and take longer"
    )
    keep: tuple[int, ...] = Field((), description="numbers of epochs after which the network is kept, in OUT/epochs")


class NetworkSettings(Group):
    """III-E: LMNet, online moving-object segmentation."""

    image: ImageSettings = ImageSettings()
    model: ModelSettings = ModelSettings()
    training: TrainingSettings = TrainingSettings()
