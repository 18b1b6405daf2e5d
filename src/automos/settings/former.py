"""Settings that had another name in earlier versions, or that are now constants.

Results store all their settings, so files of earlier versions must remain readable: renamed settings get their new
name, and removed ones are left out with a warning.
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
    "odometry.loops.min_way": "odometry.loops.min_distance",
}
"""The present name of each."""

CONSTANTS = {
    "odometry": """
        min_points max_iterations convergence initial_threshold known_threshold min_motion start_scans start_convergence
        start_clear_step start_steps start_fold_scans start_voxel start_iterations start_gain max_acceleration leap_time
        ground_scans ground_range ground_voxel ground_trials ground_distance ground_share threads voxel points_per_voxel
        refine
        """,
    "odometry.refinement": """
        surfel voxel near max_range min_points submap_every submap_length lags max_distance kernels converged noise
        close max_surfels min_matched information window overlap speed_lags speed_step speed_close speed_evidence
        overhead_weight speed_rounds speed_prior reverse_cost speed_gain acceleration_cost min_speed_ratio
        min_clear_speed standstill_share standstill_share_low near_share near_view min_step min_straightness body_range
        body_voxel body_share body_spread
        """,
    "odometry.loops": """
        place_every place_length place_scans rings sectors voxel max_turn_drift_deg max_offset max_difference candidates
        registration_distances min_points drift turn_drift_deg deviation turn_deviation_deg
        """,
    "instances": "ego_radius",
    "instances.hdbscan": "min_samples voxel",
    "network.image": "spacing residual_min_range residual_max_range",
    "network.training": """
        optimizer momentum weight_decay warm_up schedule decay patience weighed_scans seed loaders cached_scans
        """,
    "self_training": "most",
    "map": "tile picture_pixels",
    "candidates.ground": "sectors start_range step max_bend max_step max_slope ghost_depth max_depth",
    "candidates.ego_body": """
        max_scans min_scans min_distance min_overlap max_drift beyond world_distance world_share min_cells
        attached_share
        """,
    "candidates.free_space": "span_tolerance first_spans sure_hits support support_per_metre weak_weight near_miss",
    "instances.components": "torn_share torn_points torn_gap silence",
    "instances.components.segments": "height_bin thin_share thin_rows",
    "tracking.filter": "measurement_share whole_side",
    "tracking.gates": "max_climb max_size_change max_count_ratio size_weight count_weight evidence_weight",
    "tracking.judge": "min_probability prior displacement unsteady hover pieces",
    "labels": "now_speed",
    "tracking.smoothing": "noise acceleration",
    "tracking.completion": "ring ground_clearance",
}
"""Names, by group, of former settings that are now constants."""

BECAME = {
    "candidates.erasor": "its published parameters are used, see automos.baselines.erasor; remove it",
    "baselines": "other methods use the published parameters, see automos.baselines; remove it",
    "network.online": "give automos segment its --engine, --device and --threads instead",
    "network.augmentation": "network.training.augment turns it on or off",
    "network.cleanup": "RangeNet++'s values are used, see automos.network.cleanup; remove it",
    "network.scene_flow": "see automos.network.rivals; remove it",
    "network.training.optimizer": "set network.training.recipe",
    "network.training.schedule": "set network.training.recipe",
}
"""Replacements of former groups and settings: constants in the code, or options of a command."""


def with_present_names(tree: Mapping[str, Any], source: str) -> dict[str, Any]:
    """Return the settings `tree` with current names only; one warning reports the settings that were left out.

    Parameters
    ----------
    tree : Mapping[str, Any]
        Groups of settings, by name, as written by any version.
    source : str
        Their origin, for the warning.
    """
    left_out: list[str] = []
    renamed: dict[str, Any] = {}
    kept = _present(tree, "", left_out, renamed)
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
    """Raise SettingsError if `key` ("odometry.convergence") is a former setting."""
    for former, became in BECAME.items():
        if key == former or key.startswith(f"{former}."):
            raise SettingsError(f"'{key}' is not a setting any more: {became} (`automos settings` lists all)")
    if _is_constant(key):
        raise SettingsError(f"{key} is a constant now, not a setting: leave it out (`automos settings` lists all)")
    if key in RENAMED:
        raise SettingsError(f"there is no setting '{key}' any more: it is called '{RENAMED[key]}' now")


def _is_constant(key: str) -> bool:
    group, _, name = key.rpartition(".")
    is_gone = any(key == former or key.startswith(f"{former}.") for former in BECAME)
    return is_gone or name in CONSTANTS.get(group, "").split()


def _present(tree: Mapping[str, Any], prefix: str, left_out: list[str], renamed: dict[str, Any]) -> dict[str, Any]:
    """Return the settings that still exist; add constants' names to `left_out`, renamed settings to `renamed`."""
    kept = {}
    for name, value in tree.items():
        key = f"{prefix}{name}"
        if _is_constant(key):
            left_out.append(key)
        elif key in RENAMED:
            renamed[RENAMED[key]] = value
        elif isinstance(value, Mapping) and value:
            if inner := _present(value, f"{key}.", left_out, renamed):
                kept[name] = inner
        else:
            kept[name] = value
    return kept
