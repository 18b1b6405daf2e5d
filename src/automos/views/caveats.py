"""What to know before trusting the results: one sentence on whether they can be, and those that say why."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.scan import Pose
from automos.results.run_warnings import general_sentences

Json = dict[str, Any]
"""What a JSON file says, by name."""


def trust_in(run: Json, warnings: list[str], expected: float | None, truth: Json | None = None) -> dict[str, str]:
    """Return how far labels can be trusted: `level` ("yes", "look", "no") and a `sentence`.

    Poses decide first, as all evidence follows from them; then what else is odd; how sure the verdicts are is said
    anyhow, and replaced by what is known better: a random sample that a person judged, or truth.

    Parameters
    ----------
    run : run.json.
    warnings : all caveats of the run, the most serious first.
    expected : share of the moving points that is right, by the confidence of their objects; None where nothing moves.
    truth : scores of all points, where there is truth.
    """
    odometry = run.get("odometry", {})
    how_sure = _how_sure(run.get("quality") or {}, expected, truth)
    if odometry.get("warnings") or odometry.get("is_speed_doubted"):
        why = "the sensor's path is in doubt, and every label follows from it"
        return {"level": "no", "sentence": f"These labels cannot be trusted as they are: {why}; {how_sure}."}
    if warnings:
        n = len(warnings)
        why = "there is something worth knowing below" if n == 1 else f"{n} things below are worth knowing"
        return {"level": "look", "sentence": f"Look before you trust these labels: {why}; {how_sure}."}
    wall = odometry.get("wall_thickness_m")
    places = sum("scan" in warning for warning in run.get("warnings", []))
    warned = f"no warning but of {places} place{'s' * (places != 1)} below" if places else "no warning"
    walls = "" if wall is None else f" (walls seen again and again are {100 * wall:.0f} cm thick)"
    why = f"{warned}, and the path agrees with itself{walls}"
    return {"level": "yes", "sentence": f"These labels can be trusted: {why}; {how_sure}."}


def _how_sure(quality: Json, expected: float | None, truth: Json | None) -> str:
    if truth is not None and truth["iou"] is not None:
        return f"against the truth, the IoU of what moves is {100 * truth['iou']:.1f} %"
    precision = quality.get("precision")
    if precision:
        low, high = 100 * precision["low"], 100 * precision["high"]
        return f"by a random sample, {low:.0f} to {high:.0f} % of what is labelled moving does move"
    if expected is None:
        return "nothing was found to move"
    return f"by the confidence of its objects, {100 * expected:.1f} % of what is labelled moving does move"


TILT = 10.0
"""Degrees between the sensor's z-axis and up from which a sensor is tilted."""
JUMP = 20.0
"""Metres per second by which the speed changes between scans from which the poses jump: 200 m/s2 at 10 Hz."""
UNLABELED = 0.1
"""Share of points without a label from which that is worth a sentence."""
SURE = 0.7
"""Confidence below which a moving track is worth a look."""


def caveats(
    run: Json, tracks: list[Json], T_level_sensor: Pose, stamps: Array, names: list[str], counts: npt.NDArray
) -> list[str]:
    """Return the warnings of a run, the most serious first.

    Parameters
    ----------
    run, tracks : run.json, and verdict and confidence of each track.
    T_level_sensor : (N, 4, 4).   stamps : (N,) seconds.   names : N, of the scans.
    counts : (3,) points unlabeled, static and moving.
    """
    return [*general_sentences(run), *_of_path(T_level_sensor, stamps, names), *_of_labels(counts, tracks)]


def _of_path(T_level_sensor: Pose, stamps: npt.NDArray, names: list[str]) -> Iterator[str]:
    velocity = np.diff(T_level_sensor[:, :3, 3], axis=0) / np.diff(stamps)[:, None]
    change = np.linalg.norm(np.diff(velocity, axis=0), axis=1)
    if change.max(initial=0.0) >= JUMP:
        yield (
            f"The poses jump: at scan {names[change.argmax() + 1]} the sensor's speed changes by {change.max():.0f} "
            "m/s within one scan. Odometry slipped there; label again with poses of your own (--poses)."
        )
    tilt = float(np.median(np.degrees(np.arccos(np.clip(T_level_sensor[:, 2, 2], -1.0, 1.0)))))
    if tilt >= TILT:
        yield (
            f"The sensor is mounted at a tilt of {tilt:.0f}°. Boxes, heights and this page's map stand upright; if the "
            "sensor was level, the ground was not found: look at the map."
        )


def _of_labels(counts: npt.NDArray, tracks: list[Json]) -> Iterator[str]:
    unlabeled, static, moving = counts.tolist()
    total = max(unlabeled + static + moving, 1)
    if unlabeled > UNLABELED * total:
        yield (
            f"{100 * unlabeled / total:.0f} % of the points have no label: no return, the vehicle's own body, or (with "
            "--unsure) too little confidence."
        )
    if not moving:
        yield "Nothing was found to move. If something did, look at the map: are there poses?"
    unsure = sum(track["verdict"] == "moving" and track["confidence"] < SURE for track in tracks)
    if unsure:
        yield (
            f"{unsure} moving object{'s are' if unsure > 1 else ' is'} judged with a confidence below {SURE:g}; "
            "automos review shows them first."
        )
