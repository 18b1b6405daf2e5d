"""The small files by which trainers are told of a data set: classes, splits, the sensor, which scans have movers."""

from collections.abc import Mapping, Sequence

import yaml

from automos.core.arrays import Array
from automos.writers.training.scans import WIDTH, ImageSensor

SPLITS = ("train", "valid", "test")
_NAMES = {
    0: "unlabeled", 1: "outlier", 8: "unmovable", 9: "static", 10: "car", 11: "bicycle", 13: "bus", 15: "motorcycle",
    16: "on-rails", 18: "truck", 20: "other-vehicle", 30: "person", 31: "bicyclist", 32: "motorcyclist", 40: "road",
    44: "parking", 48: "sidewalk", 49: "other-ground", 50: "building", 51: "fence", 52: "other-structure",
    60: "lane-marking", 70: "vegetation", 71: "trunk", 72: "terrain", 80: "pole", 81: "traffic-sign",
    99: "other-object", 250: "movable", 251: "moving", 252: "moving-car", 253: "moving-bicyclist",
    254: "moving-person", 255: "moving-motorcyclist", 256: "moving-on-rails", 257: "moving-bus", 258: "moving-truck",
    259: "moving-other-vehicle",
}  # fmt: skip
_COLORS = ([0, 0, 0], [128, 128, 128], [255, 0, 0], [0, 0, 255])
"""Blue, green, red of what is unknown, could not move, could move, and moves."""
Split = Mapping[str, Sequence[int]]
"""Numbers of sequences, by the names in `SPLITS`."""


def classes_yaml(shares: Mapping[int, float], split: Split) -> str:
    """Return SemanticKITTI's description of classes, with the maps that LiDAR-MOS, MotionSeg3D and MF-MOS look for.

    shares : share of all points that has each number.
    """
    kinds = {number: _kind(number) for number in _NAMES}
    classes = {number: kind for number, kind in kinds.items() if number not in (8, 250)}
    moving = {number: (0, 1, 1, 2)[kind] for number, kind in classes.items()}
    movable = {number: (0, 1, 2, 2)[kind] for number, kind in classes.items()}
    inverse = {0: 0, 1: 9, 2: 251}
    return _yaml(
        {
            "name": "kitti",  # by which they choose the parser
            "labels": _NAMES,
            "color_map": {number: list(_COLORS[kind]) for number, kind in kinds.items()},
            "content": {number: float(shares.get(number, 0.0)) for number in classes},
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


def _kind(number: int) -> int:
    """Return which of the kinds in `_COLORS` a class is of."""
    if number == 250 or (10 <= number <= 32 and number != 16):
        return 2
    return 3 if number > 250 else int(number > 1)


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
