"""The methods by name, all with one interface: frames of a recording in, moving points of each frame out.

Every map-based method turns its map into labels of scans by the same rule: a point has the label of the voxel that it
fell into itself, never that of whatever is nearest in the cleaned map.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy.typing as npt

from automos.core.scan import Frames, Mask
from automos.evidence.published import FindMoving
from automos.settings import Settings


@dataclass(frozen=True)
class Method:
    """A labeler and what it is called in tables.

    Attributes
    ----------
    name, title : str
        In settings, and in tables and pictures.
    find_moving : FindMoving
        See `FindMoving`.
    needs_future : bool
        Whether a scan's labels depend on scans after it.
    """

    name: str
    title: str
    find_moving: FindMoving
    needs_future: bool = True

    @property
    def key(self) -> str:
        """The published parameters as a text."""
        return repr(published(self.name))


def _find_with(name: str, *more: str) -> FindMoving:
    """Return the labeler of method `name` with its published parameters; `more` names what else it takes."""

    def find(frames: Frames, stamps: npt.NDArray, settings: Settings, start: int) -> Iterator[tuple[int, Mask]]:
        given = {"stamps": stamps, "ground": settings.candidates.ground}
        labeler = import_module(f"automos.baselines.{name}").find_moving
        return labeler(frames, published(name), start=start, **{key: given[key] for key in more})

    return find


def published(name: str) -> Any:
    """Return the parameters of method `name` as its authors give them: a frozen dataclass, or one a sensor.

    They are not settings: one compares with what was published. `find_moving` in the method's own module takes others.
    """
    if name == "m_detector":
        return import_module("automos.baselines.m_detector").FILES
    return import_module(f"automos.baselines.{name}").Parameters()


_ALL = (
    Method("octomap", "Octomap", _find_with("octomap")),
    Method("removert", "Removert", _find_with("removert")),
    Method("erasor", "ERASOR", _find_with("erasor")),
    Method("pfreundschuh", "Pfreundschuh's", _find_with("pfreundschuh", "ground")),
    Method("yoon", "Yoon's", _find_with("yoon", "stamps", "ground")),
    Method("dufomap", "DUFOMap", _find_with("dufomap")),
    Method("m_detector", "M-detector", _find_with("m_detector", "stamps", "ground"), needs_future=False),
    Method("hmm_mos", "HMM-MOS", _find_with("hmm_mos"), needs_future=False),
)
BASELINES = {method.name: method for method in _ALL}
"""In the order of the paper's Table I, then the newer ones."""
