"""III-D: objects over time, whether they move, and which points are theirs."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class FilterSettings(Group):
    """III-D: noise of the Kalman filters (AB3DMOT's, from 0.1 s frames to seconds)."""

    initial_variance: float = Field(10.0, gt=0, description="m^2 and rad^2, of a new box")
    initial_velocity_variance: float = Field(1e6, gt=0, description="(m/s)^2, of a new box")
    process_variance: float = Field(10.0, gt=0, description="m^2 and rad^2 per second")
    process_velocity_variance: float = Field(10.0, gt=0, description="(m/s)^2 per second")
    measurement_variance: float = Field(1.0, gt=0, description="m^2 and rad^2, of a measured box")
    measurement_share: float = Field(
        0.0, ge=0, description="of a long side, by which a box's middle may be off along it"
    )
    whole_side: float = Field(3.0, ge=0, description="m, subtracted from it: sides up to this are seen whole")
    unlike_share: float = Field(
        0.0, ge=0, description="of what is seen more or less of a long thing's side, by which its middle may be off"
    )


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


_FOLLOWING = FilterSettings(
    initial_variance=0.1,
    initial_velocity_variance=4.0,
    process_variance=0.5,
    process_velocity_variance=6.0,
    measurement_variance=0.1,
    measurement_share=0.02,
)


class FollowSettings(Group):
    """Following objects by their motion and by the evidence, in metres and seconds whatever the sensor's rate."""

    filter: FilterSettings = _FOLLOWING
    speed: float = Field(15.0, gt=0, description="m/s, usual speed of what the evidence says has moved")
    gate: float = Field(3.0, gt=0, description="standard deviations between predicted and seen position")
    max_gap: float = Field(0.8, ge=0, description="s, an object may be out of sight")
    max_climb: float = Field(1.5, gt=0, description="m, between predicted and seen height")
    max_size_change: float = Field(0.7, gt=0, le=1, description="of a ground side, as a share of the longer plus 1 m")
    max_count_ratio: float = Field(5.0, gt=1, description="between the numbers of points")
    size_weight: float = Field(4.0, ge=0, description="cost of a change of size, in squared standard deviations")
    count_weight: float = Field(1.0, ge=0, description="cost of e times as many points")
    evidence_weight: float = Field(2.0, ge=0, description="cost of going from all moving to all static")


class ExtensionSettings(Group):
    """Following moving objects on where the evidence is silent."""

    filter: FilterSettings = FilterSettings(
        initial_variance=0.02,
        initial_velocity_variance=0.25,
        process_variance=0.05,
        process_velocity_variance=1.0,
        measurement_variance=0.02,
        measurement_share=0.1,
        unlike_share=0.3,
    )
    gates: FollowSettings = FollowSettings(
        filter=_FOLLOWING.model_copy(update={"measurement_share": 0.1, "unlike_share": 0.3}),
        max_gap=1.5,
        max_size_change=0.8,
        max_climb=0.5,
        evidence_weight=0.0,
    )
    min_time: float = Field(0.8, ge=0, description="s, a track seen for less is not followed on")
    min_presence: float = Field(0.4, ge=0, le=1, description="of the scans between its first and last, nor for less")
    min_points: int = Field(12, ge=1, description="in most of its scans, nor with fewer")
    max_blind_way: float = Field(1.0, ge=0, description="m, an object may go out of sight, or")
    max_blind_share: float = Field(0.25, ge=0, description="of its length, if that is more")
    count_memory: float = Field(1.0, gt=0, description="s, after which a third of its points are expected still")
    look_back: float = Field(0.5, ge=0, description="s, for which nothing else may have stood at its place")
    same_place: float = Field(0.3, ge=0, description="m, what moved and changed by less is the same, and")
    same_size: float = Field(0.3, ge=0, description="of its size, by which it may have changed besides")
    whole_size: float = Field(0.2, ge=0, description="of its size plus 1 m, by which the whole of a piece may be off")
    whole_points: float = Field(1.6, ge=1, description="times the points of the object, that it may have at most")
    fray_time: float = Field(1.0, gt=0, description="s, at a track's ends, over which its usual size there is found")
    fray_share: float = Field(0.6, ge=0, le=1, description="of that size: what is smaller is a mere piece")
    fit_time: float = Field(0.5, gt=0, description="s, before its end over which a track's velocity is fitted")


class SmoothingSettings(Group):
    """Where moving objects were and how fast, from the whole of their tracks."""

    noise: float = Field(0.15, gt=0, description="m, standard deviation of a box's centre")
    acceleration: float = Field(1.5, gt=0, description="m/s per square root of a second, by which speeds wander")


class JudgeSettings(Group):
    """When the evidence and the motion of a track make it moving."""

    min_moved_points: int = Field(10, ge=1, description="points that have moved, over all scans of the track")
    min_moved_scans: int = Field(2, ge=1, description="scans in which most of its points have moved")
    min_share: float = Field(0.5, ge=0, le=1, description="moved, of the points the evidence speaks of")
    sure_share: float = Field(0.85, gt=0, lt=1, description="moved, of all points: with more it need not go straight")
    max_climb: float = Field(1.5, ge=0, description="m, between first and last observation, or as far as it went")
    max_lift: float = Field(2.5, gt=0, description="m from the ground up to its lowest point, but for a fifth of scans")
    min_distance: float = Field(0.5, ge=0, description="m, between first and last observation")
    min_significance: float = Field(6.0, ge=0, description="speed over its standard error")
    min_straightness: float = Field(0.5, ge=0, le=1, description="distance over length of the path")
    long_side: float = Field(8.0, gt=0, description="m, of something longer now more and now less is in sight")
    long_share: float = Field(0.6, gt=0, le=1, description="moved, of the points the evidence speaks of in a scan")
    block: float = Field(0.5, gt=0, description="s, over which centres are averaged to corners of the path")
    noise: float = Field(0.1, gt=0, description="m, scatter of a box's centre that no track is without")
    alike: float = Field(0.15, gt=0, description="of its usual side plus 1 m, by which what is seen of it may differ")
    sparse_points: int = Field(10, ge=0, description="a track of fewer points in most scans is sparse")
    sparse_pieces: int = Field(50, ge=0, description="of fewer points if it is most often a piece of something")
    sparse_min_observations: int = Field(4, ge=2, description="scans a sparse track must be seen in")
    sparse_min_presence: float = Field(0.6, ge=0, le=1, description="of the scans between its first and last")
    sparse_min_straightness: float = Field(0.7, ge=0, le=1, description="distance over length of a sparse track's path")
    glimpse_points: int = Field(20, ge=0, description="a track of fewer points in most scans, and")
    glimpse_observations: int = Field(15, ge=0, description="seen in fewer scans than this, is a glimpse")
    glimpse_min_observations: int = Field(8, ge=2, description="scans a glimpse must be seen in")
    glimpse_min_share: float = Field(0.8, ge=0, le=1, description="moved, of all points of a glimpse")
    carried_reach: float = Field(
        2.5, ge=0, description="m around the sensor: how far the own vehicle's parts may reach"
    )
    carried_spread: float = Field(0.2, ge=0, description="m, how much they may change their distance, in the median")
    carried_travel: float = Field(5.0, gt=0, description="m the sensor must have gone for that to tell")


class CompletionSettings(Group):
    """Which points beside its segment belong to a moving object."""

    margin: float = Field(0.1, ge=0, description="m, around the segment's box")
    ring: float = Field(1.5, gt=0, description="m, around it: the ground beside the object")
    ground_clearance: float = Field(
        0.1, ge=0, description="m above the ground beside it, from which on it is the object"
    )


class TrackingSettings(Group):
    """III-D: tracking."""

    filter: FilterSettings = FilterSettings()
    association: AssociationSettings = AssociationSettings()
    verdict: VerdictSettings = VerdictSettings()
    max_misses: int = Field(5, ge=0, description="n_old: consecutive scans an object may be missed")
    method: Literal["evidence", "paper"] = Field("evidence", description="the paper's tracker and verdict, or ours")
    follow: FollowSettings = FollowSettings()
    judge: JudgeSettings = JudgeSettings()
    extension: ExtensionSettings = ExtensionSettings()
    smoothing: SmoothingSettings = SmoothingSettings()
    completion: CompletionSettings = CompletionSettings()
