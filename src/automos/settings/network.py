"""III-E: LMNet: its images, its model and its training."""

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class ImageSettings(Group):
    """III-E: the range image that is the input of the network."""

    height: int = Field(
        64, ge=16, multiple_of=16, description="rows, to which a sensor's beams are assigned; more take longer"
    )
    width: int = Field(2048, ge=16, multiple_of=16, description="columns; more resolve smaller objects and take longer")
    residuals: int = Field(
        8, ge=0, description="residual images, one per fifth of a second back in time; more show slower motion"
    )


class ModelSettings(Group):
    """The network's shape."""

    channels: int = Field(
        32,
        ge=4,
        multiple_of=4,
        description="channels of the first layer; 32 is full size, 8 narrow; more learn more, but slower",
    )
    dropout: float = Field(
        0.2, ge=0, lt=1, description="fraction of channels dropped in training; larger values reduce overfitting"
    )


class TrainingSettings(Group):
    """Training of the network."""

    recipe: Literal["adamw", "paper"] = Field(
        "adamw",
        description="adamw: cosine schedule; paper: SGD, decays by a hundredth per epoch and needs more epochs",
    )
    learning_rate: float | None = Field(
        None, gt=0, description="highest rate; none: the recipe's (0.002, paper 0.01); larger values forget more"
    )
    epochs: int = Field(150, ge=1, description="greatest number of epochs, of which the best is kept; more take longer")
    samples: int = Field(0, ge=0, description="scans per epoch, drawn anew each time; 0: every scan once")
    packed: int = Field(
        0, ge=0, description="scans drawn and packed in OUT before training, for a GPU; more take longer; 0: as needed"
    )
    sector: int = Field(
        0, ge=0, multiple_of=16, description="image columns per training step; 0: all; more make steps more expensive"
    )
    batch: int = Field(8, ge=1, description="scans per step and device; more need more memory and make fewer steps")
    augment: bool = Field(True, description="tilt, mirror, shift and thin scans, against overfitting to few scans")
    use_confidence: bool = Field(False, description="weight the loss of every point by the confidence of its label")
    validation_scans: int = Field(
        100, ge=1, description="evenly spread scans to validate an epoch; more are more exact and take longer"
    )
    seed: int = Field(0, ge=0, description="of all that is drawn: scans, how they are changed, the first weights")
    keep: tuple[int, ...] = Field((), description="numbers of epochs after which the network is saved in OUT/epochs")


class NetworkSettings(Group):
    """III-E: LMNet, online moving-object segmentation."""

    image: ImageSettings = ImageSettings()
    model: ModelSettings = ModelSettings()
    training: TrainingSettings = TrainingSettings()
