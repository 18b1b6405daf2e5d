"""What data sets for detectors have in common: names of kinds, and a split."""

CLASSES = ("Vehicle", "Pedestrian", "Cyclist")
CLASS_OF_KIND = (0, 0, 2, 1, 0)
"""Index into `CLASSES` of each `Kind`: what is of no kind is no person."""


def split_of(frames: list[str]) -> dict[str, list[str]]:
    """Return names of `frames` for training and, the last fifth in time, for validation."""
    edge = len(frames) - len(frames) // 5
    return {"train": frames[:edge], "val": frames[edge:]}
