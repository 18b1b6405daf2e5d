"""III-D: tracks, whether they move, and their points."""

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class FilterSettings(Group):
    """III-D: noise of the Kalman filters."""

    initial_variance: float = Field(0.1, gt=0, description="m^2, rad^2, of a new box; more trusts the next boxes more")
    initial_velocity_variance: float = Field(4.0, gt=0, description="(m/s)^2, of a new box; more allows faster objects")
    process_variance: float = Field(0.5, gt=0, description="m^2, rad^2 per second; more trusts measured boxes more")
    process_velocity_variance: float = Field(6.0, gt=0, description="(m/s)^2 per second; more follows manoeuvres")
    measurement_variance: float = Field(0.1, gt=0, description="m^2, rad^2, of a measured box; more smooths more")


class AssociationSettings(Group):
    """III-D: the gates of the association cost, in which distance, overlap and volume weigh the same (III-F)."""

    max_distance: float = Field(2.0, gt=0, description="m, T_d, predicted to detected centre; more allows more pairs")
    max_overlap_cost: float = Field(0.95, gt=0, le=1, description="T_o, of 1 - IoU; more allows more pairs")
    max_volume_cost: float = Field(0.7, gt=0, le=1, description="T_v, of 1 - smaller / larger volume; more adds pairs")


class VerdictSettings(Group):
    """III-D: when a track counts as moving."""

    trajectory: Literal["net", "accumulated"] = Field("net", description="measure of a trajectory's length")
    min_observations: int = Field(6, ge=1, description="observations of a moving track; more makes short tracks static")


class GateSettings(Group):
    """Gates of the association of segments and tracks, in metres and seconds at any scan rate."""

    speed: float = Field(15.0, gt=0, description="m/s, usual speed of a new mover; more opens its first gate")
    gate: float = Field(3.0, gt=0, description="standard deviations of the innovation; more allows more pairs")


class CompletionSettings(Group):
    """Which points beside its segment belong to a moving object."""

    margin: float = Field(0.1, ge=0, description="m around the segment's box; more adds points beside the object")


class TrackingSettings(Group):
    """III-D: tracking."""

    method: Literal["evidence", "paper"] = Field("evidence", description="evidence: ours; paper: its costs and verdict")
    filter: FilterSettings = FilterSettings()
    max_misses: int = Field(0, ge=0, description="n_old: consecutive scans a track may be missed; more bridges longer")
    max_gap: float = Field(0.8, ge=0, description="s, the same as a time; the longer of both applies")
    association: AssociationSettings = AssociationSettings()
    verdict: VerdictSettings = VerdictSettings()
    gates: GateSettings = GateSettings()
    completion: CompletionSettings = CompletionSettings()
