"""Settings that had another name in earlier versions, or that are none any more.

Results store all their settings, so files of earlier versions must remain readable: renamed settings get their new
name, and of files that hold all settings, as results do, those that are gone are left out with a warning.
"""

import logging
from collections.abc import Mapping
from typing import Any

from automos.core.errors import SettingsError

_log = logging.getLogger(__name__)

RENAMED = {
    "odometry.refinement.max_acceleration": "odometry.usual_acceleration",
    "odometry.refinement.max_turn_acceleration_deg": "odometry.usual_turn_acceleration_deg",
    "odometry.refinement.max_speed": "odometry.max_speed",
    "odometry.refinement.max_reverse": "odometry.max_reverse",
    "odometry.refinement.overhead": "odometry.overhead",
    "odometry.loop_closure": "map.loop_closure",
    "odometry.loops.reach": "map.loops.reach",
    "odometry.loops.min_way": "map.loops.min_distance",
    "odometry.loops.min_distance": "map.loops.min_distance",
    "odometry.loops.max_drift": "map.loops.max_drift",
    "odometry.loops.min_overlap": "map.loops.min_overlap",
}
"""The present name of each."""

BECAME = {
    "candidates.erasor": "its published parameters are used, see automos.baselines.erasor; remove it",
    "baselines": "other methods use the published parameters, see automos.baselines; remove it",
    "network.model.name": "every network is a SalsaNext; remove it",
    "network.online": "give automos segment its --engine, --device and --threads instead",
    "network.augmentation": "network.training.augment turns it on or off",
    "network.cleanup": "RangeNet++'s values are used, see automos.network.cleanup; remove it",
    "network.scene_flow": "see automos.network.rivals; remove it",
    "self_training": "labels were no better with a network's probabilities; remove it",
    "candidates.free_space.spans": "they follow from candidates.free_space.longest_span",
    "candidates.free_space.margin": "candidates.free_space.hit says it, too; remove it",
    "candidates.free_space.margin_per_metre": "candidates.free_space.hit_per_metre says it, too; remove it",
    "instances.components.segments.gap_columns": "set instances.components.segments.gap_rays",
    "instances.components.segments.height_gap": "set instances.components.segments.gap",
    "instances.components.segments.height_gap_rows": "set instances.components.segments.gap_rays",
    "instances.components.min_share": "most of the known points decide; remove it",
    "tracking.association.weight_distance": "all weights are 1, as in the paper; remove it",
    "tracking.association.weight_overlap": "all weights are 1, as in the paper; remove it",
    "tracking.association.weight_volume": "all weights are 1, as in the paper; remove it",
    "network.training.optimizer": "set network.training.recipe",
    "network.training.schedule": "set network.training.recipe",
}
"""Replacements of former groups and settings: constants in the code, or options of a command."""


def with_present_names(tree: Mapping[str, Any], known: set[str], source: str) -> dict[str, Any]:
    """Return the settings `tree` with current names; one warning reports the settings that were left out.

    Parameters
    ----------
    tree : Mapping[str, Any]
        Groups of settings, by name, as written by any version.
    known : set of str
        The dotted names of all settings and groups.
    source : str
        Their origin, for the warning.
    """
    has_all = {"odometry", "candidates", "instances", "tracking", "labels"} <= tree.keys()
    left_out: list[str] = []
    renamed: dict[str, Any] = {}

    def present(branch: Mapping[str, Any], prefix: str) -> dict[str, Any]:
        kept = {}
        for name, value in branch.items():
            key = f"{prefix}{name}"
            if key in RENAMED:
                renamed[RENAMED[key]] = value
            elif isinstance(value, Mapping) and value and not _is_leaf(key, known):
                if inner := present(value, f"{key}."):
                    kept[name] = inner
            elif key in known or not has_all:
                kept[name] = value
            else:
                left_out.append(key)
        return kept

    kept = present(tree, "")
    for key, value in renamed.items():
        *groups, name = key.split(".")
        branch = kept
        for group in groups:
            branch = branch.setdefault(group, {})
        branch.setdefault(name, value)
    if left_out:
        others = f" and {len(left_out) - 1} more are" if len(left_out) > 1 else " is"
        _log.warning("%s: %s%s left out: they are constants now, not settings", source, left_out[0], others)
    return kept


def refuse_former_name(key: str) -> None:
    """Raise SettingsError if `key` ("network.online.engine") is a former setting."""
    for former, became in BECAME.items():
        if key == former or key.startswith(f"{former}."):
            raise SettingsError(f"'{key}' is not a setting any more: {became} (`automos settings` lists all)")
    if key in RENAMED:
        raise SettingsError(f"there is no setting '{key}' any more: it is called '{RENAMED[key]}' now")


def _is_leaf(key: str, known: set[str]) -> bool:
    return key in known and not any(name.startswith(f"{key}.") for name in known)
