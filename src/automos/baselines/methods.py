"""The methods by name, all with one interface: frames of a recording in, moving points of each frame out.

Every map-based method turns its map into labels of scans by the same rule: a point has the label of the voxel that it
fell into itself, never that of whatever is nearest in the cleaned map.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy.typing as npt

from automos.core.scan import Frames, Mask
from automos.evidence.paper import erasor
from automos.settings import Settings

Labeler = Callable[[Frames, npt.NDArray, Settings, int], Iterator[tuple[int, Mask]]]
"""Takes frames, their times (N,) in s, all settings and the first index wanted; yields (index, (M,) bool moving)."""


@dataclass(frozen=True)
class Method:
    """A labeler and what it is called in tables.

    Attributes
    ----------
    title : str
        In tables and pictures.
    find_moving : Labeler
        See `Labeler`.
    needs_future : bool
        Whether a scan's labels depend on scans after it.
    """

    title: str
    find_moving: Labeler
    needs_future: bool = True


def _find_with(name: str, *more: str) -> Labeler:
    """Return the labeler of method `name` with its published parameters; `more` names what else it takes."""

    def find(frames: Frames, stamps: npt.NDArray, settings: Settings, start: int) -> Iterator[tuple[int, Mask]]:
        given = {"stamps": stamps, "ground": settings.candidates.ground}
        labeler = import_module(f"automos.baselines.{name}").find_moving
        return labeler(frames, published(name), start=start, **{key: given[key] for key in more})

    return find


def published(name: str) -> Any:
    """Return the parameters of method `name` as its authors give them, a frozen dataclass; None of ERASOR.

    They are not settings: one compares with what was published. `find_moving` in the method's own module takes others.
    """
    if name == "m_detector":
        return import_module("automos.baselines.m_detector_parameters").KITTI
    return None if name == "erasor" else import_module(f"automos.baselines.{name}").Parameters()


def _erasor(frames: Frames, stamps: npt.NDArray, settings: Settings, start: int) -> Iterator[tuple[int, Mask]]:
    for i, score in erasor.find_candidates(frames, settings.candidates.erasor, start):
        yield i, score > 0.5


BASELINES = {
    "octomap": Method("Octomap", _find_with("octomap")),
    "removert": Method("Removert", _find_with("removert")),
    "erasor": Method("ERASOR", _erasor),
    "pfreundschuh": Method("Pfreundschuh's", _find_with("pfreundschuh", "ground")),
    "yoon": Method("Yoon's", _find_with("yoon", "stamps", "ground")),
    "dufomap": Method("DUFOMap", _find_with("dufomap")),
    "m_detector": Method("M-detector", _find_with("m_detector", "stamps", "ground"), needs_future=False),
    "hmm_mos": Method("HMM-MOS", _find_with("hmm_mos"), needs_future=False),
}
"""In the order of the paper's Table I, then the newer ones."""
