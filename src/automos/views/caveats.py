"""What to know before trusting the results, in sentences."""

from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.scan import Pose
from automos.results.run_warnings import general_sentences

TILT = 10.0
"""Degrees between the sensor's z-axis and up from which a sensor is tilted."""
JUMP = 20.0
"""Metres per second by which the speed changes between scans from which the poses jump: 200 m/s2 at 10 Hz."""
UNLABELED = 0.1
"""Share of points without a label from which that is worth a sentence."""
SURE = 0.7
"""Confidence below which a moving track is worth a look."""


def caveats(
    run: dict[str, Any],
    tracks: list[dict[str, Any]],
    T_level_sensor: Pose,
    stamps: npt.NDArray[np.float64],
    names: list[str],
    counts: npt.NDArray[np.int64],
) -> list[str]:
    """Return the warnings of a run, the most serious first.

    Parameters
    ----------
    run, tracks : run.json, and verdict and confidence of each track.
    T_level_sensor : (N, 4, 4).   stamps : (N,) seconds.   names : N, of the scans.
    counts : (3,) points unlabeled, static and moving.
    """
    return [
        *general_sentences(run),
        *_jumps(T_level_sensor, stamps, names),
        *_tilt(T_level_sensor),
        *_points(counts),
        *_unsure(tracks),
    ]


def _jumps(T_level_sensor: Pose, stamps: npt.NDArray, names: list[str]) -> list[str]:
    if len(stamps) < 3:
        return []
    velocity = np.diff(T_level_sensor[:, :3, 3], axis=0) / np.diff(stamps)[:, None]
    change = np.linalg.norm(np.diff(velocity, axis=0), axis=1)
    worst = int(change.argmax())
    if change[worst] < JUMP:
        return []
    return [
        f"The poses jump: at scan {names[worst + 1]} the sensor's speed changes by {change[worst]:.0f} m/s within one "
        "scan. Odometry slipped there; label again with poses of your own (--poses)."
    ]


def _tilt(T_level_sensor: Pose) -> list[str]:
    tilt = float(np.median(np.degrees(np.arccos(np.clip(T_level_sensor[:, 2, 2], -1.0, 1.0)))))
    if tilt < TILT:
        return []
    return [
        f"The sensor is mounted at a tilt of {tilt:.0f}°. Boxes, heights and this page's map stand upright; if the "
        "sensor was level, the ground was not found: look at the map."
    ]


def _points(counts: npt.NDArray[np.int64]) -> list[str]:
    unlabeled, static, moving = counts.tolist()
    total = max(unlabeled + static + moving, 1)
    found = []
    if unlabeled > UNLABELED * total:
        found.append(
            f"{100 * unlabeled / total:.0f} % of the points have no label: no return, the vehicle's own body, or (with "
            "--unsure) too little confidence."
        )
    if not moving:
        found.append("Nothing was found to move. If something did, look at the map: are there poses?")
    return found


def _unsure(tracks: list[dict[str, Any]]) -> list[str]:
    unsure = [track for track in tracks if track["verdict"] == "moving" and track["confidence"] < SURE]
    if not unsure:
        return []
    return [
        f"{len(unsure)} moving object{'s are' if len(unsure) > 1 else ' is'} judged with a confidence below {SURE:g}; "
        "automos review shows them first."
    ]
