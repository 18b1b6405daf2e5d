"""How good poses are: drift against reference poses, wrong speeds and whether a warning says so, thickness of walls."""

import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from ablation import changed, parsed
from recordings import opened

from automos import ArraySequence, load_settings
from automos.core.scan import Sequence
from automos.evaluation.trajectory import RelativeErrors, errors_over_distance, errors_over_time
from automos.odometry.estimate import estimate_trajectory
from automos.odometry.trajectory import Trajectory
from automos.settings import OdometrySettings

STANDING = 1.0
"""Metres of a stretch below which it has no error in percent."""
OFF = 0.03
"""Share of the way by which the poses of a bad drive are off."""
SHORT = 5.0
"""Metres of a third of a drive over which nothing shorter counts."""
SAYS_SO = re.compile(r"trust|\bposes?\b", re.IGNORECASE)
"""What a warning of wrong poses speaks of."""


def drift(recording: str, store: Path, method: str = "default", change: str = "") -> dict[str, Any]:
    """Return errors in percent of the distance driven meanwhile, walls and seconds.

    Stretches start at every scan; one on which the vehicle came less than a metre has none. Wall thickness is what
    surfaces seen a second apart measure across: it needs no reference, and tells how good the reference itself is.
    """
    overrides, constants = parsed(change)
    settings = load_settings(method, None, overrides).odometry
    with opened(recording, store) as made, changed(constants):
        sequence, reference = made.sequence, made.sequence.reference_poses
        row: dict[str, Any] = {"scans": len(sequence), "walls_reference_m": _walls(sequence, settings, reference)}
        wall, cpu = time.perf_counter(), time.process_time()
        found = estimate_trajectory(sequence, settings)
        seconds = {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
        row |= {
            **_errors(found, reference),
            "walls_m": found.diagnostics["wall_thickness_m"],
            **{f"{clock}_seconds_per_scan": value / len(sequence) for clock, value in seconds.items()},
        }
    return row


def _errors(found: Trajectory, reference: npt.NDArray[np.float64]) -> dict[str, Any]:
    poses, stamps = found.T_world_sensor, found.stamps
    return {
        "10 m": _figures(errors_over_distance(poses, reference, 10.0)),
        "1 s": _figures(errors_over_time(poses, reference, stamps, 1.0)),
        "5 s": _figures(errors_over_time(poses, reference, stamps, 5.0)),
    }


def _figures(errors: RelativeErrors) -> dict[str, float] | None:
    is_driven = errors.length >= STANDING
    if not is_driven.any():
        return None
    percent = errors.translation_percent[is_driven]
    return {"mean": float(percent.mean()), "median": float(np.median(percent)), "max": float(percent.max())}


def _walls(sequence: Sequence, settings: OdometrySettings, poses: npt.NDArray[np.float64]) -> float | None:
    return estimate_trajectory(sequence, settings, poses=poses).diagnostics["wall_thickness_m"]


def speed(recording: str, store: Path, method: str = "default", change: str = "", missing: int = 0) -> dict[str, Any]:
    """Return the share of the way by which poses are off, by the worst third of the drive, and what was said of them.

    With `missing`, every so many-th scan is left out, and all stamps.
    """
    overrides, constants = parsed(change)
    with opened(recording, store) as made, changed(constants):
        sequence, true = made.sequence, made.sequence.reference_poses
        if missing:
            kept = [i for i in range(len(sequence)) if i % missing != missing - 1]
            sequence, true = ArraySequence([sequence[i].points for i in kept]), true[kept]
        found = estimate_trajectory(sequence, load_settings(method, None, overrides).odometry)
    return {
        "off": speed_error(found.T_world_sensor, true),
        "way_m": float(np.linalg.norm(np.diff(true[:, :3, 3], axis=0), axis=1).sum()),
        "said": [text for text in found.diagnostics.get("warnings", []) if SAYS_SO.search(text)],
    }


def speed_error(estimated: npt.NDArray[np.float64], true: npt.NDArray[np.float64]) -> float:
    """Return by what share of the way the chords of (N, 4, 4) poses are off in the worst third."""
    ends = np.linspace(0, len(true) - 1, 4).round().astype(int)
    there, here = (np.linalg.norm(np.diff(poses[ends, :3, 3], axis=0), axis=1) for poses in (estimated, true))
    return float((np.abs(there - here) / np.maximum(here, SHORT)).max())
