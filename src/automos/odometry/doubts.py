"""What a reader of the poses should doubt, in sentences."""

from typing import Any

from automos.odometry.motion import MAX_ACCELERATION
from automos.odometry.vertical import Level
from automos.settings import OdometrySettings


def vertical_doubts(level: Level) -> list[str]:
    """Return the warnings, in sentences, that follow from the vertical found."""
    if level.is_doubtful:
        return [
            "which way is up is in doubt: a plane that fits as well lies elsewhere than below an upright sensor. The "
            "sensor is taken to stand upright; if it hangs, turn the points by 180 degrees about its x axis."
        ]
    if not level.has_ground:
        return ["no ground found near the sensor; its z axis is used as vertical and its height as zero."]
    return []


def doubts(figures: dict[str, Any], settings: OdometrySettings, has_clock: bool = True) -> list[str]:
    """Return the warnings, in sentences, that follow from the `figures` of a run."""
    found = []
    if figures.get("is_speed_doubted", False):
        faster, here, there = (figures[k] for k in ("rival_faster_m_s", "landmarks_refound", "refound_at_rival"))
        found.append(
            "the speed is in doubt: of the landmarks that cannot be traffic (higher than any vehicle, far beside the "
            f"road), {here:.0f} are re-observed at the estimated speed, {there:.0f} if the sensor is {abs(faster):.0f} "
            f"m/s {'faster' if faster > 0.0 else 'slower'}. The poses may follow traffic rather than the world; do not "
            "trust the labels: give your own poses (--poses)."
        )
    acceleration = figures.get("greatest_acceleration_m_s2", 0.0)
    # Without stamps it may be overestimated: the slowest sensors turn half as fast as is assumed.
    if acceleration > MAX_ACCELERATION * (1.0 if has_clock else 2.0**2):
        found.append(
            f"around scan {figures['greatest_acceleration_at']} the speed changes by {acceleration:.0f} m/s per "
            "second, more than any vehicle can. The poses before or after it are wrong and may follow traffic rather "
            "than the world; do not trust the labels there: give your own poses (--poses)."
        )
    thickness, disagreement = figures["wall_thickness_m"], figures["baseline_disagreement_m"]
    if thickness is not None and (thickness > settings.max_wall_thickness or disagreement > settings.max_disagreement):
        found.append(
            f"scans a second apart do not align with each other: walls are {100 * thickness:.0f} cm thick and poses "
            f"disagree by {100 * disagreement:.0f} cm. Poses or point times are inaccurate, so labels will be, too."
        )
    return found
