"""The small files by which trainers are told of a data set: classes, splits, the sensor, which scans have movers."""

from collections.abc import Mapping, Sequence

import yaml

from automos.core.arrays import Array
from automos.writers.training.scans import WIDTH, ImageSensor

SPLITS = ("train", "valid", "test")
_MOVABLE = {
    10: "car", 11: "bicycle", 13: "bus", 15: "motorcycle", 18: "truck", 20: "other-vehicle", 30: "person",
    31: "bicyclist", 32: "motorcyclist",
}  # fmt: skip
_FIXED = {
    9: "static", 16: "on-rails", 40: "road", 44: "parking", 48: "sidewalk", 49: "other-ground", 50: "building",
    51: "fence", 52: "other-structure", 60: "lane-marking", 70: "vegetation", 71: "trunk", 72: "terrain", 80: "pole",
    81: "traffic-sign", 99: "other-object",
}  # fmt: skip
_MOVING = {
    251: "moving", 252: "moving-car", 253: "moving-bicyclist", 254: "moving-person", 255: "moving-motorcyclist",
    256: "moving-on-rails", 257: "moving-bus", 258: "moving-truck", 259: "moving-other-vehicle",
}  # fmt: skip
_UNKNOWN = {0: "unlabeled", 1: "outlier"}
Split = Mapping[str, Sequence[int]]
"""Numbers of sequences, by the names in `SPLITS`."""


def classes_yaml(shares: Mapping[int, float], split: Split) -> str:
    """Return SemanticKITTI's description of classes, with the maps that LiDAR-MOS, MotionSeg3D and MF-MOS look for.

    shares : share of all points that has each number.
    """
    names = {**_UNKNOWN, **_FIXED, **_MOVABLE, **_MOVING}
    moving = {number: 2 if number in _MOVING else int(number not in _UNKNOWN) for number in sorted(names)}
    movable = {number: 2 if number in _MOVABLE else kind for number, kind in moving.items()}
    inverse = {0: 0, 1: 9, 2: 251}
    return _yaml(
        {
            "name": "kitti",  # by which they choose the parser
            "labels": dict(sorted({**names, 8: "unmovable", 250: "movable"}.items())),
            "color_map": {number: _color(number) for number in sorted({*names, 8, 250})},
            "content": {number: float(shares.get(number, 0.0)) for number in sorted(names)},
            "learning_map": moving,
            "learning_map_inv": inverse,
            "moving_learning_map": moving,
            "moving_learning_map_inv": inverse,
            "movable_learning_map": movable,
            "movable_learning_map_inv": {0: 0, 1: 8, 2: 250},
            "learning_ignore": {0: True, 1: False, 2: False},
            "split": {name: list(split[name]) for name in SPLITS},
        }
    )


def _color(number: int) -> list[int]:
    """Return blue, green, red: what moves is red, what could move blue, all else grey."""
    if number in _MOVING:
        return [0, 0, 255]
    return [255, 0, 0] if number in _MOVABLE or number == 250 else [128, 128, 128] if number > 1 else [0, 0, 0]


def sensor_yaml(sensor: ImageSensor, statistics: Array, max_points: int) -> str:
    """Return the part `dataset` of the architecture that trainers on range images read.

    statistics : (2, 5) means and deviations of range, x, y, z, intensity.
    """
    means, deviations = statistics.round(4).tolist()
    about = {
        "name": "automos",
        "type": "spherical",
        "fov_up": sensor.fov_up,
        "fov_down": sensor.fov_down,
        "img_prop": {"width": WIDTH, "height": sensor.height},
        "img_means": means,
        "img_stds": deviations,
    }
    return _yaml({"dataset": {"labels": "kitti", "scans": "kitti", "max_points": max_points, "sensor": about}})


def sequences_yaml(split: Mapping[str, Sequence[str]]) -> str:
    """Return the part `training` of 4DMOS's and MapMOS's configuration: how they call the sequences of each split."""
    return _yaml({"training": {"id": "automos", "train": list(split["train"]), "val": list(split["valid"])}})


def insmos_yaml(split: Split) -> str:
    """Return the splits in InsMOS's configuration."""
    names = {"TRAIN": "train", "VAL": "valid", "TEST": "test"}
    return _yaml({"DATA": {"SPLIT": {theirs: list(split[ours]) for theirs, ours in names.items()}}})


def _yaml(content: object) -> str:
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120)
