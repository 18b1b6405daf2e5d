"""Changes of the method, by name or by place: what is a setting, a number or a rule worth?

A change is one of `CHOICES`, each of which takes something back, or PLACE=VALUE: a setting (`tracking.max_gap=0`), or a
constant beside its code as "module:NAME" or "module:NAME.key" (`automos.objects.terms:PIECE=0`). Several are
joined by " + ". A constant that a compiled kernel reads as a global cannot be changed so.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from automos.core.beam_pattern import BeamPattern
from automos.core.errors import InputError
from automos.core.scan import Mask, Points
from automos.odometry import missing_scans
from automos.settings import PRESETS

NEVER = 1e9


def no_clouds(points: Points, is_between: npt.NDArray, is_object: Mask) -> Mask:
    """Return (M,) that no point is in a cloud, as `automos.evidence.clouds.in_clouds` does where there is none."""
    return np.zeros(len(points), np.bool_)


def all_possible(votes: npt.NDArray, pattern: BeamPattern, reach: npt.NDArray) -> Mask:
    """Return (H, W) that every possible ego body is one, whatever the votes of others on it."""
    return reach > 0.0


def all_constant(ends: npt.NDArray, *_: Any) -> Mask:
    """Return (H, W) that every part of a possible ego body stays put, in place of those that do."""
    return np.logical_or(*(ends > 0.0))


def everywhere(extents: list[npt.NDArray[np.float32]]) -> npt.NDArray[np.float32]:
    """Return (S,) an extent of 10 m in every direction, in place of the one that is learnt from those of the scans."""
    return np.full_like(extents[0], 10.0)


JUDGE, TERMS, PAIRS = (f"automos.objects.{module}" for module in ("judge", "terms", "association"))
BODY = "automos.evidence.ego_body"
CHOICES: dict[str, dict[str, Any]] = {
    "everything": {},
    "evidence of 1 s only": {"candidates.free_space.longest_span": 1.0},
    "a lone point seen through counts in full": {"candidates.free_space.lone_weight": 1.0},
    "ERASOR instead of free space": {"candidates.method": "erasor"},
    "HDBSCAN instead of components": {"instances.method": "hdbscan"},
    "clouds are objects": {"automos.evidence.observations:in_clouds": no_clouds},
    "what rides along is an object": {f"{BODY}:MIN_SCANS": 10**9},
    "nothing is connected to the body": {"automos.evidence.on_body:ATTACHED_SHARE": NEVER},
    "all that is connected is body": {f"{BODY}:extent_in_most": everywhere},
    "all that keeps its range is body": {f"{BODY}:decide_body": all_possible},
    "edges of the body may move": {f"{BODY}:_stays_put": all_constant},
    "grazed faces keep their range": {f"{BODY}:GRAZING": 0.0},
    "within arm's reach all may be objects": {f"{BODY}:NEAR_SHARE": NEVER},
    "the walk on the ground begins level": {"automos.evidence.ground:PLANE_LEAD": NEVER},
    "objects of 20 m at most": {"instances.components.max_side": 20.0},
    "unsteady things move, too": {f"{JUDGE}:UNSTEADY": 0.0},
    "pieces are as good as wholes": {f"{TERMS}:PIECE": 0.0},
    "dust is as good as faces": {f"{TERMS}:POROUS": 0.0},
    "what overlaps may be another": {f"{PAIRS}:MIN_OVERLAP": 2.0},
    "objects may climb": {f"{PAIRS}:MAX_CLIMB": NEVER},
    "objects may lose their points": {f"{PAIRS}:MAX_COUNT_RATIO": NEVER},
    "sizes do not choose": {f"{PAIRS}:SIZE_WEIGHT": 0.0},
    "evidence does not choose": {f"{PAIRS}:EVIDENCE_WEIGHT": 0.0},
    "nothing is out of sight for long": {"tracking.max_gap": 0.0},
    "what movers pass by moves, too": {"automos.objects.places:OUTNUMBERED": NEVER},
    "ground beside objects stays ground": {"tracking.completion.margin": 0.0},
    "the paper's tracker and verdict": {f"tracking.{k}": v for k, v in PRESETS["paper"]["tracking"].items()},
}  # fmt: skip


OTHER_METHODS = (
    *("ERASOR instead of free space", "HDBSCAN instead of components"),
    "the paper's tracker and verdict",
)
"""Choices of whole methods, not of a rule or a term."""


def _no_rivals(*still: Any) -> list[Any]:
    return []


def _none_missing(window: Any, settings: Any, pool: Any = None) -> Any:
    return window.gaps


def _as_registered(window: Any, settings: Any, pool: Any = None) -> Any:
    return window


def _nothing_refound(window: Any, overhead: Any, pool: Any) -> npt.NDArray:
    return np.zeros((len(window) - 1, len(missing_scans.TRIED)))


SPEED, GAPS = "automos.odometry.likely_speed", "automos.odometry.missing_scans"
ODOMETRY: dict[str, dict[str, Any]] = {
    "starts at other speeds": {"automos.odometry.path:first_steps": lambda T, fastest: T[None]},
    "a search for the speed": {f"{SPEED}:ROUNDS": 1, f"{SPEED}:lengthen": lambda T, longer: T},
    "a search from a standstill": {f"{SPEED}:rivals_from_rest": _no_rivals},
    "the rival that landmarks propose": {f"{SPEED}:is_ahead": lambda *evidence: False},
    "isolated points": {
        "automos.odometry.facing:count_met_again": lambda *met: 0.0,
        f"{GAPS}:count_met_again": lambda *met: 0.0,
    },
    "missing scans counted": {"automos.odometry.settling:count_missing": _none_missing},
    "missing scans counted by what faces along the path": {f"{GAPS}:refound_after": _nothing_refound},
    "missing scans counted at the speed that is searched first": {f"{GAPS}:to_likely_speed": _as_registered},
}
"""Parts of the odometry that are left out."""


def parsed(change: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the settings and the constants that a change gives other values.

    Raises
    ------
    InputError
        It is no name of `CHOICES` or `ODOMETRY`, and no PLACE=VALUE.
    """
    given: dict[str, Any] = {}
    for part in filter(None, change.split(" + ")):
        place, is_place, value = part.partition("=")
        if part in CHOICES | ODOMETRY:
            given |= (CHOICES | ODOMETRY)[part]
        elif is_place:
            given[place] = yaml.safe_load(value)
        else:
            raise InputError(f"'{part}' is no change: name one of benchmarks/ablation.py, or give PLACE=VALUE")
    constants = {place: value for place, value in given.items() if ":" in place}
    return {place: value for place, value in given.items() if ":" not in place}, constants


def cumulative(names: list[str]) -> list[str]:
    """Return changes of which each has all before it, too."""
    return [" + ".join(names[: n + 1]) for n in range(len(names))]


@contextmanager
def changed(constants: dict[str, Any]) -> Iterator[None]:
    """Give constants, by "module:NAME" or "module:NAME.key", other values for a while."""
    before = []
    for place, value in constants.items():
        module, _, name = place.partition(":")
        name, _, key = name.partition(".")
        owner: Any = import_module(module)
        holder, at = (getattr(owner, name), key) if key else (vars(owner), name)
        before.append((holder, at, holder[at]))
        holder[at] = value
    try:
        yield
    finally:
        for holder, at, value in before:
            holder[at] = value
