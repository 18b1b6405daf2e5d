"""III-D: objects over time, whether they move, and which points are theirs."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class FilterSettings(Group):
    """III-D: noise of the Kalman filters."""

    initial_variance: float = Field(0.1, gt=0, description="m^2 and rad^2, of a new box")
    initial_velocity_variance: float = Field(4.0, gt=0, description="(m/s)^2, of a new box")
    process_variance: float = Field(0.5, gt=0, description="m^2 and rad^2 per second")
    process_velocity_variance: float = Field(6.0, gt=0, description="(m/s)^2 per second")
    measurement_variance: float = Field(0.1, gt=0, description="m^2 and rad^2, of a measured box")


class AssociationSettings(Group):
    """III-D: the association cost and its gates (values: III-F)."""

    weight_distance: float = Field(1.0, ge=0, description="alpha_d")
    weight_overlap: float = Field(1.0, ge=0, description="alpha_o")
    weight_volume: float = Field(1.0, ge=0, description="alpha_v")
    max_distance: float = Field(2.0, gt=0, description="m, T_d, between predicted and detected centre")
    max_overlap_cost: float = Field(0.95, gt=0, le=1, description="T_o, of 1 - IoU")
    max_volume_cost: float = Field(0.7, gt=0, le=1, description="T_v, of 1 - smaller / larger volume")


class VerdictSettings(Group):
    """III-D: when a track counts as moving."""

    trajectory: Literal["net", "accumulated"] = Field("net", description="how the length of a trajectory is measured")
    min_observations: int = Field(6, ge=1, description="a track seen less often is static")


class GateSettings(Group):
    """Which segment may be which object, and what makes it likely: in metres and seconds whatever the sensor's rate."""

    speed: float = Field(15.0, gt=0, description="m/s, usual speed of what the evidence says has moved")
    gate: float = Field(3.0, gt=0, description="standard deviations between predicted and seen position")


class JudgeSettings(Group):
    """When a track counts as moving."""

    min_probability: float = Field(0.82, gt=0, lt=1, description="of having moved, from which on it is labelled moving")


class CompletionSettings(Group):
    """Which points beside its segment belong to a moving object."""

    margin: float = Field(0.1, ge=0, description="m, around the segment's box")


class TrackingSettings(Group):
    """III-D: tracking."""

    method: Literal["evidence", "paper"] = Field("evidence", description="the paper's costs and verdict, or ours")
    filter: FilterSettings = FilterSettings()
    max_misses: int = Field(0, ge=0, description="n_old: consecutive scans an object may be missed, or")
    max_gap: float = Field(0.8, ge=0, description="s, if that is longer")
    association: AssociationSettings = AssociationSettings()
    verdict: VerdictSettings = VerdictSettings()
    gates: GateSettings = GateSettings()
    judge: JudgeSettings = JudgeSettings()
    completion: CompletionSettings = CompletionSettings()
