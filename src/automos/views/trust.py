"""One sentence on whether the labels of a run can be trusted, with why."""

from typing import Any


def trust_in(
    run: dict[str, Any], warnings: list[str], expected: float | None, truth: dict[str, Any] | None = None
) -> dict[str, str]:
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


def _how_sure(quality: dict[str, Any], expected: float | None, truth: dict[str, Any] | None) -> str:
    if truth is not None and truth["iou"] is not None:
        return f"against the truth, the IoU of what moves is {100 * truth['iou']:.1f} %"
    precision = quality.get("precision")
    if precision:
        low, high = 100 * precision["low"], 100 * precision["high"]
        return f"by a random sample, {low:.0f} to {high:.0f} % of what is labelled moving does move"
    if expected is None:
        return "nothing was found to move"
    return f"by the confidence of its objects, {100 * expected:.1f} % of what is labelled moving does move"
