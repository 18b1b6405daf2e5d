"""III-E: LMNet, how it sees, learns and runs; and the rival that thresholds scene flow."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class ImageSettings(Group):
    """III-E: the range image that the network sees."""

    height: int = Field(64, ge=16, multiple_of=16, description="rows; a sensor's beams are shared out among them")
    width: int = Field(2048, ge=16, multiple_of=16, description="columns")
    residuals: int = Field(8, ge=0, description="residual images, one each for as many earlier scans")
    spacing: float = Field(0.1, gt=0, description="s between the scans of successive residual images")
    residual_min_range: float = Field(2.0, ge=0, description="m, nearer points have no residual")
    residual_max_range: float = Field(50.0, gt=0, description="m, points further away have no residual")


class ModelSettings(Group):
    """The network's shape."""

    name: Literal["salsanext", "rangenet"] = "salsanext"
    channels: int = Field(32, ge=4, multiple_of=4, description="of the first layer; 32 is full size, 8 narrow")
    dropout: float = Field(0.2, ge=0, lt=1, description="share of channels left out while training")


class AugmentationSettings(Group):
    """Changes of the world that should change no label, each with its probability."""

    turn: float = Field(1.0, ge=0, le=1, description="probability of a turn about the vertical by any angle")
    mirror: float = Field(0.5, ge=0, le=1, description="probability of exchanging left and right")
    shift: float = Field(0.5, ge=0, le=1, description="probability of a shift")
    shift_x: float = Field(2.0, ge=0, description="m, at most")
    shift_y: float = Field(2.0, ge=0, description="m, at most")
    shift_z: float = Field(0.3, ge=0, description="m, at most")
    drop: float = Field(0.5, ge=0, le=1, description="probability of dropping points")
    max_dropped: float = Field(0.5, ge=0, lt=1, description="share of points dropped at most")
    no_intensity: float = Field(0.3, ge=0, le=1, description="probability of doing without intensities")


class TrainingSettings(Group):
    """How the network learns (LMNet: SGD at 0.01, 150 epochs)."""

    epochs: int = Field(150, ge=1, description="at most")
    samples: int = Field(0, ge=0, description="scans an epoch, drawn anew each time; 0: every scan once")
    batch: int = Field(8, ge=1, description="scans a step and device")
    optimizer: Literal["adamw", "sgd"] = "adamw"
    learning_rate: float = Field(0.002, gt=0, description="at its highest")
    momentum: float = Field(0.9, ge=0, lt=1, description="of sgd")
    weight_decay: float = Field(1e-4, ge=0)
    warm_up: float = Field(1.0, ge=0, description="epochs until the learning rate is at its highest")
    schedule: Literal["cosine", "exponential"] = "cosine"
    decay: float = Field(0.99, gt=0, le=1, description="factor of the learning rate per epoch, if exponential")
    patience: int = Field(30, ge=1, description="epochs without a better validation until training stops")
    use_confidence: bool = Field(False, description="weigh every point's loss by the confidence of its label")
    validation_scans: int = Field(100, ge=1, description="scans an epoch is judged by, evenly spread")
    weighed_scans: int = Field(60, ge=1, description="scans in which classes are counted for their weights")
    keep: tuple[int, ...] = Field((), description="numbers of epochs after which the network is kept, in OUT/epochs")
    seed: int = Field(0, ge=0)
    loaders: int = Field(0, ge=0, description="processes that prepare scans; 0: the training process itself")
    cached_scans: int = Field(4000, ge=0, description="scans kept in memory, thinned to one point per pixel")


class CleanUpSettings(Group):
    """From pixels back to points (RangeNet++)."""

    window: int = Field(5, ge=1, le=15, description="pixels, width and height of where voters are looked for")
    voters: int = Field(5, ge=1, description="pixels that vote on a point")
    sigma: float = Field(1.0, gt=0, description="pixels, how soon far voters count less")
    cutoff: float = Field(1.0, gt=0, description="m, pixels whose range differs by more do not vote")


class OnlineSettings(Group):
    """The network on the robot."""

    engine: Literal["auto", "torch", "onnxruntime", "openvino"] = Field("auto", description="what runs the network")
    device: Literal["auto", "cpu", "gpu"] = "auto"
    threads: int = Field(0, ge=0, description="of the network on a CPU; 0: one per core")
    timing_scans: int = Field(16, ge=8, description="scans after which it is found out how sweeps are timed")
    pattern_points: int = Field(1000, ge=100, description="points a scan needs to show the sensor's beams")


class SceneFlowSettings(Group):
    """The rival that thresholds scene flow (IV-C)."""

    max_range: float = Field(50.0, gt=0, description="m, points further away count as static")
    min_height: float = Field(0.3, description="m above the ground under the first scan; lower points are static")
    neighbours: int = Field(16, ge=1, description="points whose median flow a point takes")
    min_speed: float = Field(1.4, gt=0, description="m/s from which on a point moves (SeFlow: 0.14 m a scan)")
    max_speed: float = Field(44.0, gt=0, description="m/s, faster is a point that appeared")


class NetworkSettings(Group):
    """III-E: LMNet, online moving-object segmentation."""

    image: ImageSettings = ImageSettings()
    model: ModelSettings = ModelSettings()
    augmentation: AugmentationSettings = AugmentationSettings()
    training: TrainingSettings = TrainingSettings()
    cleanup: CleanUpSettings = CleanUpSettings()
    online: OnlineSettings = OnlineSettings()
    scene_flow: SceneFlowSettings = SceneFlowSettings()
