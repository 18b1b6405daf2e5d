"""Every number that shapes a result, with its unit, range and, where it comes from the paper, its section.

Lengths are metres, angles degrees, times seconds. The preset "paper" is the seed paper to the letter; "default" is
whatever measures best. Order of precedence: preset < settings file < command line.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from automos.errors import SettingsError


class _Group(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)


class RefineSettings(_Group):
    """Refinement of the poses over longer baselines."""

    surfel: float = Field(0.4, gt=0, description="m, edge of the voxels scans are thinned to; doubles with distance")
    voxel: float = Field(0.8, gt=0, description="m, edge of a submap's voxels; doubles with distance")
    near: float = Field(20.0, gt=0, description="m up to which voxels have their least size")
    max_range: float = Field(80.0, gt=0, description="m, points used")
    min_points: int = Field(3, ge=1, description="points that make a surfel")
    submap_every: float = Field(0.5, gt=0, description="s between the middles of submaps")
    submap_length: float = Field(0.3, ge=0, description="s of scans in a submap")
    lags: tuple[float, ...] = Field((0.5, 1.0, 2.0), description="s between a scan and the submaps it is laid on")
    max_distance: float = Field(25.0, gt=0, description="m between a scan and the submaps it is laid on")
    kernels: tuple[float, ...] = Field(
        (0.5, 0.2, 0.1, 0.1), min_length=1, description="m, one round each: residuals much longer count little"
    )
    converged: float = Field(0.003, ge=0, description="m, a round that moves no scan further is the last")
    noise: float = Field(0.03, gt=0, description="m, deviation of a surfel on a perfect surface")
    close: float = Field(0.1, gt=0, description="m, surfels nearer to a surface than this lie on it")
    max_surfels: int = Field(2500, ge=100, description="surfels of a scan laid on one submap, at most")
    min_matched: int = Field(50, ge=6, description="surfels on surfaces a scan and a submap need in common")
    information: float = Field(0.05, gt=0, le=1, description="share of a surfel's weight that is not its neighbours'")
    max_acceleration: float = Field(3.0, gt=0, description="m/s^2, usual change of speed")
    max_turn_acceleration_deg: float = Field(60.0, gt=0, description="deg/s^2, usual change of turn rate")
    window: float = Field(20.0, gt=0, description="s of recording refined at once")
    overlap: float = Field(6.0, gt=0, description="s of it that are refined again with the next")
    speed_lags: tuple[float, ...] = Field((0.3, 0.8), min_length=1, description="s over which speed is searched")
    speed_step: float = Field(0.125, gt=0, description="m/s between speeds tried")
    max_speed: float = Field(45.0, gt=0, description="m/s tried at most")
    max_reverse: float = Field(10.0, ge=0, description="m/s tried backwards")
    speed_close: float = Field(0.15, gt=0, description="m, surfels nearer to a surface than this have found it again")
    speed_evidence: float = Field(5.0, gt=0, description="surfels found again that count for half of full certainty")
    speed_gain: float = Field(0.2, gt=0, lt=1, description="share by which another speed must explain more")
    acceleration_cost: float = Field(
        0.1, ge=0, description="share that an acceleration of max_acceleration must explain"
    )
    min_speed_ratio: float = Field(0.8, gt=0, le=1, description="of true speed to first estimate, at least")
    min_clear_speed: float = Field(2.0, gt=0, description="m/s, slower first estimates may be a mistaken standstill")
    standstill_share: float = Field(
        0.25, gt=0, lt=1, description="of what faces along the way, found where it was: with less, none stands"
    )
    min_step: float = Field(0.1, gt=0, description="m, shorter steps have no direction")
    min_straightness: float = Field(
        0.8, gt=0, lt=1, description="how much steps agree on their direction in the sensor's frame"
    )
    body_range: float = Field(6.0, ge=0, description="m within which the vehicle's own body is looked for")
    body_voxel: float = Field(0.4, gt=0, description="m")
    body_share: float = Field(0.8, gt=0, le=1, description="share of scans that must see it at the same place")
    body_spread: float = Field(0.04, gt=0, description="m, deviation of that place")


class LoopSettings(_Group):
    """Loop closure: when a place counts as seen before."""

    place_every: float = Field(5.0, gt=0, description="m driven between places")
    place_length: float = Field(10.0, gt=0, description="m driven whose scans show a place")
    place_scans: int = Field(5, ge=1, description="of these scans")
    reach: float = Field(40.0, gt=0, description="m around a place")
    rings: int = Field(20, ge=1)
    sectors: int = Field(60, ge=4)
    voxel: float = Field(0.5, gt=0, description="m, one point per voxel; what is nearer lies on each other")
    min_way: float = Field(50.0, gt=0, description="m driven before a place can be seen again")
    max_drift: float = Field(0.05, ge=0, description="of the way, by which poses may be off")
    max_turn_drift_deg: float = Field(0.3, gt=0, description="deg per m of the way, by which they may be turned")
    max_offset: float = Field(8.0, gt=0, description="m between places that show the same")
    max_difference: float = Field(0.4, gt=0, le=1, description="between places that look alike")
    candidates: int = Field(3, ge=1, description="places tried for each, most alike first")
    registration_distances: tuple[float, ...] = Field(
        (8.0, 3.0, 1.0), min_length=1, description="m, one registration each: pairs further apart are left out"
    )
    min_overlap: float = Field(0.7, gt=0, le=1, description="share of what stands on the ground that must lie close")
    min_points: int = Field(100, ge=3, description="on which this is judged")
    drift: float = Field(0.05, gt=0, description="m over 10 m, usual drift of the odometry")
    turn_drift_deg: float = Field(0.1, gt=0, description="deg over 10 m")
    deviation: float = Field(0.03, gt=0, description="m, usual error of a revisit's registration")
    turn_deviation_deg: float = Field(0.05, gt=0, description="deg")


class OdometrySettings(_Group):
    """III-A: poses of every scan."""

    voxel: float | None = Field(None, gt=0, description="m, local map voxel; none: a hundredth of max_range")
    max_range: float = Field(100.0, gt=0, description="m, points used for registration")
    min_range: float = Field(1.0, ge=0, description="m, points used for registration")
    min_points: int = Field(50, ge=3, description="a scan with fewer usable points is not registered")
    points_per_voxel: int = Field(20, ge=1, description="points kept in a voxel of the local map")
    max_iterations: int = Field(500, ge=1, description="of one registration")
    convergence: float = Field(
        1e-3, gt=0, description="m, a registration ends with a step shorter than this; KISS-ICP's own is 1e-4"
    )
    initial_threshold: float = Field(2.0, gt=0, description="m, deviation expected while the motion is unknown")
    known_threshold: float = Field(0.5, gt=0, description="m, deviation expected at first once the motion is known")
    min_motion: float = Field(0.1, gt=0, description="m, deviations below this do not adapt the threshold")
    start_scans: int = Field(6, ge=1, description="scans registered twice, to know the motion during the first")
    start_convergence: float = Field(1e-4, gt=0, description="m, the same as `convergence` for these, at most")
    start_clear_step: float = Field(0.2, gt=0, description="m from scan to scan, faster starts are no mistaken rest")
    start_steps: tuple[float, ...] = Field((1.0, 2.5), description="m from scan to scan, tried at slower ones")
    start_fold_scans: int = Field(10, ge=3, description="scans whose folding decides between these")
    start_voxel: float = Field(1.5, gt=0, description="m, local map voxel in these trials")
    start_iterations: int = Field(20, ge=1, description="of one registration in these trials")
    start_gain: float = Field(0.2, ge=0, lt=1, description="share by which they must fold better")
    max_acceleration: float = Field(4.0, gt=0, description="m/s^2, a speed that rises faster was wrong before")
    leap_time: float = Field(0.5, gt=0, description="s, for which it must")
    time: Literal["auto", "file", "azimuth", "none"] = Field(
        "auto",
        description="where the points' times come from for motion compensation: the file, the azimuth, or none "
        "(already compensated); auto takes the file's, else finds out which of the others folds the scans best",
    )
    timing_stretches: int = Field(2, ge=1, description="places of the recording where ways to time points are tried")
    timing_scans: int = Field(16, ge=3, description="scans at each")
    timing_refinement: RefineSettings = Field(
        RefineSettings(kernels=(0.2, 0.2), noise=0.05, submap_length=0.5, max_distance=40.0, max_surfels=1200),
        description="how poses are made to suit each way: wide enough not to overlook what does not fit",
    )
    timing_motion: float = Field(0.3, ge=0, description="m that the motion in a sweep must bend it for a place to tell")
    timing_gain: float = Field(0.03, ge=0, lt=1, description="share by which another way must fold scans better")
    max_wall_thickness: float = Field(0.08, gt=0, description="m over one second, thicker walls are warned of")
    max_disagreement: float = Field(
        0.1, gt=0, description="m between short and second-long baselines, more is warned of"
    )
    ground_scans: int = Field(20, ge=1, description="scans in which the ground is looked for")
    ground_range: float = Field(20.0, gt=0, description="m around the sensor in which the ground is looked for")
    ground_voxel: float = Field(0.5, gt=0, description="m, one point per voxel is used to find the ground")
    ground_trials: int = Field(1000, ge=1, description="planes through three points tried")
    ground_distance: float = Field(0.15, gt=0, description="m, points nearer a plane than this lie on it")
    ground_share: float = Field(0.1, gt=0, lt=1, description="share of the near surface that must be ground")
    max_tilt_deg: float = Field(45.0, gt=0, le=90, description="deg between the sensor's z axis and the vertical")
    min_height: float = Field(0.1, ge=0, description="m, sensor over ground")
    max_height: float = Field(5.0, gt=0, description="m, sensor over ground")
    refine: bool = Field(True, description="lay scans on submaps seconds away, too")
    refinement: RefineSettings = Field(default_factory=RefineSettings)
    loop_closure: bool = Field(
        False, description="take out the drift that revisits show; poses bend a little, which costs labels"
    )
    loops: LoopSettings = Field(default_factory=LoopSettings)
    threads: int = Field(0, ge=0, description="shapes no result; 0: as many as the run has workers")


class ErasorSettings(_Group):
    """III-B: ERASOR (Lim et al., RA-L 2021). Defaults: the whole-sequence preset of its authors (large_scale_05)."""

    version: Literal[2, 3] = Field(3, description="2: the paper's decision; 3: the released one")
    max_range: float = Field(80.0, gt=0, description="m, radius of the volume of interest")
    rings: int = Field(20, gt=0)
    sectors: int = Field(108, gt=0)
    min_height: float = Field(-1.3, description="m above the ground under the sensor")
    max_height: float = Field(3.0, description="m above the ground under the sensor")
    scan_ratio: float = Field(0.2, gt=0, lt=1, description="pseudo occupancy ratio below which a bin has changed")
    min_points: int = Field(6, ge=1, description="scan points a bin needs to be compared")
    bin_max_height: float = Field(0.2, description="m, version 2: a removed bin must reach higher than this")
    min_removed_span: float = Field(0.5, ge=0, description="m, version 3: a removed bin must span more than this")
    ground_seed_height: float = Field(0.5, gt=0, description="m above the lowest points: seeds of the plane")
    ground_lowest_skipped: int = Field(5, ge=0, description="lowest points skipped as outliers")
    ground_lowest: int = Field(20, gt=0, description="lowest points whose mean starts the plane")
    ground_iterations: int = Field(3, ge=1)
    ground_distance: float = Field(0.25, gt=0, description="m, points nearer the plane (or below it) are ground")
    voxel: float = Field(0.2, gt=0, description="m, map and scan voxel")
    every: int = Field(4, ge=1, description="every how many scans the map is compared with")
    ego_radius: float = Field(2.7, ge=0, description="m, points nearer than this are the vehicle itself")
    submap_scans: int = Field(200, ge=2, description="scans in one submap, at most")
    submap_length: float = Field(160.0, gt=0, description="m driven in one submap, at most")


class GroundSettings(_Group):
    """The ground of one scan: walked outwards from the sensor, then a height map."""

    cell: float = Field(0.5, gt=0, description="m, side of a cell of the height map, and depth of a sector's cell")
    max_range: float = Field(80.0, gt=0, description="m, how far ground is looked for")
    sectors: int = Field(360, ge=8, description="sectors around the sensor")
    start_range: float = Field(10.0, gt=0, description="m, the ground's height is first taken from within this")
    step: float = Field(0.12, gt=0, description="m, ground may rise or fall by this at once (a kerb)")
    max_bend: float = Field(0.06, gt=0, description="m per m, how fast the ground's slope may change")
    max_step: float = Field(
        0.3, gt=0, description="m, most that ground may differ from what is expected, however far on"
    )
    max_slope: float = Field(0.35, gt=0, description="steepest ground, rise over run")
    ghost_depth: float = Field(0.15, gt=0, description="m, a sight this far under nearer ground is a mirror image")
    tolerance: float = Field(0.08, gt=0, description="m, points at most this far above the surface are ground")
    tolerance_per_metre: float = Field(0.0015, ge=0, description="m more for each metre of distance from the sensor")
    max_depth: float = Field(0.3, gt=0, description="m, points further below the surface than this are not ground")


class EgoBodySettings(_Group):
    """The vehicle's own body: what keeps its range in the sensor's frame while the sensor moves."""

    max_range: float = Field(8.0, gt=0, description="m, how far the body may reach from the sensor")
    max_scans: int = Field(40, ge=2, description="scans looked at, spread over the recording")
    min_scans: int = Field(9, ge=3, description="with fewer scans apart from each other nothing is called body")
    min_distance: float = Field(1.0, gt=0, description="m, how far apart the sensor must be in scans looked at")
    min_share: float = Field(0.7, gt=0, le=1, description="share of those scans that must return the same range")
    min_overlap: float = Field(
        0.8, gt=0, le=1, description="share of a part that must stay put all along the recording"
    )
    tolerance: float = Field(0.06, gt=0, description="m, ranges nearer to each other than this are the same")
    max_drift: float = Field(0.025, gt=0, description="m, of a part's range from one third of the recording to another")


class SegmentSettings(_Group):
    """Segments of the whole non-ground scan."""

    cell: float = Field(0.25, gt=0, description="m, side of a cell seen from above")
    max_range: float = Field(120.0, gt=0, description="m, half the side of the area looked at")
    height_bin: float = Field(0.1, gt=0, description="m, resolution in height; 64 bins from the ground up")
    gap: float = Field(0.5, gt=0, description="m, things nearer to each other than this are one, seen from above")
    gap_columns: float = Field(
        2.5, ge=0, description="the same in distances between neighbouring rays, if that is more"
    )
    height_gap: float = Field(0.4, gt=0, description="m, likewise in height")
    height_gap_rows: float = Field(1.6, ge=0, description="added to it: distances between neighbouring rows of rays")
    thin_share: float = Field(0.25, ge=0, description="points per row of rays: a stack of fewer joins no two things")
    thin_rows: int = Field(6, ge=1, description="rows of rays through a stack, from which on that can be told")


class HdbscanSettings(_Group):
    """III-C: class-agnostic segments by HDBSCAN, and the boxes kept."""

    epsilons: tuple[float, ...] = Field(
        (2.0, 1.0, 0.5, 0.25), min_length=1, description="m, density thresholds, decreasing (III-F)"
    )
    min_samples: int = Field(5, ge=1, description="neighbours that make a point dense")
    min_points: int = Field(5, ge=1, description="N_min: smaller segments are dropped (III-F)")
    max_side: float = Field(20.0, gt=0, description="m, T_size: larger segments are dropped (III-F)")
    min_score: float = Field(0.5, ge=0, le=1, description="share of candidates from which on a segment is an instance")
    voxel: float = Field(0.1, ge=0, description="m, points are clustered as voxels of this size; 0: as they are")

    @field_validator("epsilons")
    @classmethod
    def _check_epsilons(cls, epsilons: tuple[float, ...]) -> tuple[float, ...]:
        # Segments are nested, and their tree is one, only where each eps is smaller than the one before.
        if not all(a > b for a, b in pairwise([*epsilons, 0.0])):
            raise ValueError("they must be greater than 0 and decrease")
        return epsilons


class DetectSettings(_Group):
    """Segments of the whole scan, cut by the evidence of motion."""

    segments: SegmentSettings = SegmentSettings()
    moved_score: float = Field(0.62, ge=0, le=1, description="score from which on a point has moved")
    stayed_score: float = Field(0.38, ge=0, le=1, description="score up to which a point has stayed")
    min_points: int = Field(3, ge=1, description="points of the smallest object")
    max_side: float = Field(45.0, gt=0, description="m, longest object")
    min_share: float = Field(0.5, ge=0, le=1, description="moved, of the points the evidence speaks of")
    torn_share: float = Field(
        0.1, ge=0, le=0.5, description="of its evidence: a segment with more than this both moved and stayed is torn"
    )
    torn_points: int = Field(20, ge=1, description="points, and at least as many as this")
    torn_gap: float = Field(0.3, gt=0, description="m, at which it is split, if its parts are not torn then")
    silence: float = Field(
        0.2, ge=0, le=1, description="stayed, of all points: up to this a segment is unknown, not static"
    )


class FilterSettings(_Group):
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


class AssociationSettings(_Group):
    """III-D: the association cost and its gates (values: III-F)."""

    weight_distance: float = Field(1.0, ge=0, description="alpha_d")
    weight_overlap: float = Field(1.0, ge=0, description="alpha_o")
    weight_volume: float = Field(1.0, ge=0, description="alpha_v")
    max_distance: float = Field(2.0, gt=0, description="m, T_d, between predicted and detected centre")
    max_overlap_cost: float = Field(0.95, gt=0, le=1, description="T_o, of 1 - IoU")
    max_volume_cost: float = Field(0.7, gt=0, le=1, description="T_v, of 1 - smaller / larger volume")


class VerdictSettings(_Group):
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


class FollowSettings(_Group):
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


class ExtensionSettings(_Group):
    """Following moving objects on where the evidence is silent."""

    filter: FilterSettings = FilterSettings(
        initial_variance=0.02,
        initial_velocity_variance=0.25,
        process_variance=0.05,
        process_velocity_variance=1.0,
        measurement_variance=0.02,
        measurement_share=0.1,
    )
    gates: FollowSettings = FollowSettings(
        filter=_FOLLOWING.model_copy(update={"measurement_share": 0.1}),
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
    look_back: float = Field(0.5, ge=0, description="s, for which nothing else may have stood at its place")
    same_place: float = Field(0.3, ge=0, description="m, what moved and changed by less is the same, and")
    same_size: float = Field(0.3, ge=0, description="of its size, by which it may have changed besides")
    whole_size: float = Field(0.2, ge=0, description="of its size plus 1 m, by which the whole of a piece may be off")
    whole_points: float = Field(1.6, ge=1, description="times the points of the object, that it may have at most")
    fray_time: float = Field(1.0, gt=0, description="s, at a track's ends, over which its usual size there is found")
    fray_share: float = Field(0.6, ge=0, le=1, description="of that size: what is smaller is a mere piece")
    fit_time: float = Field(0.5, gt=0, description="s, before its end over which a track's velocity is fitted")


class SmoothingSettings(_Group):
    """Where moving objects were and how fast, from the whole of their tracks."""

    noise: float = Field(0.15, gt=0, description="m, standard deviation of a box's centre")
    acceleration: float = Field(1.5, gt=0, description="m/s per square root of a second, by which speeds wander")


class JudgeSettings(_Group):
    """When the evidence and the motion of a track make it moving."""

    min_moved_points: int = Field(10, ge=1, description="points that have moved, over all scans of the track")
    min_moved_scans: int = Field(2, ge=1, description="scans in which most of its points have moved")
    min_share: float = Field(0.5, ge=0, le=1, description="moved, of the points the evidence speaks of")
    sure_share: float = Field(0.85, gt=0, lt=1, description="moved, of all points: with more it need not go straight")
    min_distance: float = Field(0.5, ge=0, description="m, between first and last observation")
    min_significance: float = Field(6.0, ge=0, description="speed over its standard error")
    min_straightness: float = Field(0.5, ge=0, le=1, description="distance over length of the path")
    long_side: float = Field(8.0, gt=0, description="m, of something longer now more and now less is in sight")
    long_share: float = Field(0.6, gt=0, le=1, description="moved, of the points the evidence speaks of in a scan")
    block: float = Field(0.5, gt=0, description="s, over which centres are averaged to corners of the path")
    noise: float = Field(0.1, gt=0, description="m, scatter of a box's centre that no track is without")
    alike: float = Field(0.15, gt=0, description="of its usual side plus 1 m, by which what is seen of it may differ")
    sparse_points: int = Field(10, ge=0, description="a track of fewer points in most scans is sparse")
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


class CompletionSettings(_Group):
    """Which points beside its segment belong to a moving object."""

    margin: float = Field(0.1, ge=0, description="m, around the segment's box")
    ring: float = Field(1.5, gt=0, description="m, around it: the ground beside the object")
    ground_clearance: float = Field(
        0.1, ge=0, description="m above the ground beside it, from which on it is the object"
    )


class TrackingSettings(_Group):
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


class FreeSpaceSettings(_Group):
    """Evidence of motion: which places were seen to be empty before or after."""

    spans: tuple[float, ...] = Field(
        (0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0, 4.0, 5.5, 8.0),
        min_length=1,
        description="s, how long before and after a scan others are asked",
    )
    span_tolerance: float = Field(0.25, gt=0, lt=1, description="of a span, how far off the asked scan may be")
    far_from: float = Field(2.5, gt=0, description="s, over longer spans only scans far_step apart are asked")
    far_step: float = Field(0.4, gt=0, description="s, between the scans that are asked over long spans")
    first_spans: tuple[float, ...] = Field(
        (0.6, 1.7, 4.0, 8.0), min_length=1, description="s, asked first; what they agree to have hit has stayed"
    )
    sure_hits: int = Field(2, ge=1, description="hits without a see-through after which no more scans are asked")
    margin: float = Field(0.2, gt=0, description="m, how far behind a point rays must go on to have seen through it")
    margin_per_metre: float = Field(0.005, ge=0, description="added to it per metre of range")
    hit: float = Field(0.25, gt=0, description="m, how near to a point a ray must end to have hit it again")
    hit_per_metre: float = Field(0.005, ge=0, description="added to it per metre of range")
    clear_width: float = Field(0.2, gt=0, description="m, how wide the place must be free to be seen through")
    near_miss: float = Field(0.25, gt=0, description="m, a see-through counts in full if a row of rays came so near")
    weak_weight: float = Field(0.5, ge=0, le=1, description="of a see-through by the nearest rays only")
    support: float = Field(0.3, gt=0, description="m, in range between points that are of one thing")
    support_per_metre: float = Field(0.02, ge=0, description="added to it per metre of range")
    lone_weight: float = Field(0.25, ge=0, le=1, description="of a see-through of what no neighbouring ray has met")
    stay_weight: float = Field(0.25, ge=0, description="of a hit while the thing was there; 1 more while it was away")


class CandidatesSettings(_Group):
    """III-B: which points may be dynamic."""

    method: Literal[
        "free_space", "erasor", "octomap", "removert", "yoon", "pfreundschuh", "dufomap", "m_detector", "hmm_mos"
    ] = "free_space"
    ground: GroundSettings = GroundSettings()
    ego_body: EgoBodySettings = EgoBodySettings()
    erasor: ErasorSettings = ErasorSettings()
    free_space: FreeSpaceSettings = FreeSpaceSettings()


class BatchSettings(_Group):
    """How map-based methods cut a recording: batches overlap, so what stands at the end of one is seen to leave."""

    scans: int = Field(200, ge=2, description="scans in one batch, at most")
    length: float = Field(160.0, gt=0, description="m driven in one batch, at most")


class OctomapSettings(_Group):
    """Octomap-based removal (Arora et al., ECMR 2021)."""

    batch: BatchSettings = BatchSettings()
    voxel: float = Field(0.1, gt=0, description="m")
    max_range: float = Field(60.0, gt=0, description="m, longer rays are not cast; their ends are unknown")
    hit: float = Field(0.7, gt=0.5, lt=1, description="probability of occupied given a hit")
    miss: float = Field(0.4, gt=0, lt=0.5, description="probability of occupied given a ray through")
    lowest: float = Field(0.12, gt=0, lt=0.5, description="probability, no voxel is freer")
    highest: float = Field(0.97, gt=0.5, lt=1, description="probability, none more occupied")
    image_range: float = Field(50.0, gt=0, description="m around the sensor, height images")
    image_cells: tuple[float, ...] = Field(
        (0.05, 0.07, 0.09, 0.11, 0.13), min_length=1, description="m, pixels of the height images"
    )
    image_low: float = Field(-0.27, description="m above the ground under the sensor, black of the height images")
    image_high: float = Field(3.23, description="m above the ground under the sensor, white")
    weak_edge: float = Field(15.0, gt=0, description="grey values, Canny's lower threshold")
    strong_edge: float = Field(300.0, gt=0, description="grey values, Canny's upper threshold")
    max_ground: float = Field(0.63, description="m above the ground under the sensor, what is higher is no ground")
    ground_share: float = Field(0.5, ge=0, le=1, description="of the height images that must call a point ground")
    neighbours: int = Field(5, ge=1, description="nearest known points that decide on an unknown one")


class RemovertSettings(_Group):
    """Removert (Kim and Kim, IROS 2020): remove at fine resolutions, revert at coarse ones."""

    batch: BatchSettings = BatchSettings(scans=150)
    voxel: float = Field(0.05, gt=0, description="m, of the map")
    max_range: float = Field(80.0, gt=0, description="m, points used")
    remove: tuple[float, ...] = Field((2.5, 2.0, 1.5), min_length=1, description="pixels per degree, one pass each")
    revert: tuple[float, ...] = Field((1.0, 0.9, 0.8, 0.7), description="pixels per degree, one pass each; none: off")
    every: int = Field(5, ge=1, description="every how many scans the map is compared with")
    max_elevation_deg: float = Field(25.0, gt=0, le=90, description="deg above and below the sensor that is looked at")
    difference: float = Field(0.05, gt=0, description="of the range, by which the map must be nearer than the scan")


class YoonSettings(_Group):
    """Yoon, Tang and Barfoot (CRV 2019): residuals, checked for free space, grown."""

    gap: float = Field(0.5, gt=0, description="s between a scan and those before and after that it is compared with")
    residual: float = Field(0.3, gt=0, description="m to the nearest point of the other scan, from which on: candidate")
    window_deg: float = Field(0.5, gt=0, description="deg, rays of the other scan that speak of a candidate")
    margin: float = Field(0.5, gt=0, description="m, how far behind a candidate these rays must all end")
    box_deg: float = Field(1.0, gt=0, description="deg, half the side of the box filter in the range image")
    box_points: int = Field(4, ge=1, description="candidates in the box, itself counted, to keep one")
    grow_gap: float = Field(0.4, gt=0, description="m, regions do not cross wider gaps")
    grow_steps: int = Field(5, ge=0, description="such steps, at most, from a seed")
    max_range: float = Field(80.0, gt=0, description="m, points used")


class PfreundschuhSettings(_Group):
    """Pfreundschuh et al. (ICRA 2021) as Chen et al. ran it: Removert's visibility, voted on by HDBSCAN clusters."""

    min_cluster_size: int = Field(10, ge=2, description="voxels")
    voxel: float = Field(0.15, ge=0, description="m, points are clustered as voxels of this size; 0: as they are")
    max_range: float = Field(60.0, gt=0, description="m, points used")
    share: float = Field(0.3, gt=0, le=1, description="of a cluster's points that must have been seen through")


class DufomapSettings(_Group):
    """DUFOMap (Duberg et al., RA-L 2024): the authors' library, its own names."""

    batch: BatchSettings = BatchSettings()
    resolution: float = Field(0.1, gt=0, description="m, voxel")
    d_s: float = Field(0.2, ge=0, description="m, hits are inflated by")
    d_p: int = Field(2, ge=0, description="voxels, the unknown is inflated by")
    min_range: float = Field(0.2, gt=0, description="m; points at the sensor itself poison its map")
    max_range: float = Field(50.0, gt=0, description="m, points used")


class MDetectorSettings(_Group):
    """M-detector (Wu et al., Nature Communications 2024): occlusion against past depth images, then clusters."""

    images: int = Field(10, ge=2, description="past depth images asked")
    gap: float = Field(0.1, gt=0, description="s between them")
    row_deg: float = Field(0.6, gt=0, description="deg, pixel of a depth image in elevation")
    column_deg: float = Field(0.4, gt=0, description="deg, pixel in azimuth")
    depth: float = Field(0.3, gt=0, description="m, points whose depths differ by more occlude one another")
    depth_share: float = Field(0.01, ge=0, description="of the range, added to it")
    min_occluded: int = Field(3, ge=1, description="images whose points are occluded, of those that see the place")
    max_agreeing: int = Field(0, ge=0, description="images on whose static points it lies, at most")
    chain: int = Field(3, ge=1, description="how often in a row something goes behind (or before) itself")
    max_speed: float = Field(40.0, gt=0, description="m/s, of what goes along a ray")
    cluster_voxel: float = Field(0.3, gt=0, description="m, events in touching voxels are one cluster")
    cluster_points: int = Field(10, ge=1, description="events that make a cluster")
    cluster_steps: int = Field(2, ge=0, description="voxels by which clusters are completed, over what is not ground")
    max_range: float = Field(80.0, gt=0, description="m, points used")


class HmmMosSettings(_Group):
    """HMM-MOS (Bhandari et al., 2024): a hidden Markov model per voxel, filtered in space and time."""

    batch: BatchSettings = BatchSettings()
    voxel: float = Field(0.25, gt=0, description="m")
    max_range: float = Field(50.0, gt=0, description="m, points used")
    deviation: float = Field(0.25, gt=0, description="m, of a hit around the surface that caused it")
    change: float = Field(0.005, gt=0, lt=0.5, description="probability per scan that a voxel's state changes")
    sure: float = Field(0.99, gt=0.5, lt=1, description="probability from which on a state is believed")
    memory: int = Field(300, ge=1, description="scans for which a change is remembered")
    reach: int = Field(2, ge=0, description="voxels around, 2: 5 x 5 x 5, over which changes are summed")
    window: int = Field(5, ge=1, description="scans, likewise")
    min_sum: float = Field(3.0, ge=0, description="changes that make motion, at least; Otsu may ask for more")


class BaselinesSettings(_Group):
    """IV-B: the methods that ours is compared with. ERASOR's settings are those of the candidates."""

    octomap: OctomapSettings = OctomapSettings()
    removert: RemovertSettings = RemovertSettings()
    yoon: YoonSettings = YoonSettings()
    pfreundschuh: PfreundschuhSettings = PfreundschuhSettings()
    dufomap: DufomapSettings = DufomapSettings()
    m_detector: MDetectorSettings = MDetectorSettings()
    hmm_mos: HmmMosSettings = HmmMosSettings()


class InstancesSettings(_Group):
    """III-C: what belongs together in one scan."""

    method: Literal["components", "hdbscan"] = "components"
    max_range: float = Field(80.0, gt=0, description="m, points further away are in no instance")
    ego_radius: float = Field(2.7, ge=0, description="m, points nearer than this are in no instance")
    hdbscan: HdbscanSettings = HdbscanSettings()
    components: DetectSettings = DetectSettings()


class LabelsSettings(_Group):
    """What makes a point moving or static in the end."""

    moving: Literal["sequence", "now"] = Field("sequence", description="moved at some time, or moves in this scan")
    now_speed: float = Field(0.5, ge=0, description="m/s from which on an object moves now")
    unsure: float = Field(0.0, ge=0, le=1, description="confidence below which a point is unlabeled")


class MapSettings(_Group):
    """The map without what moves (paper Fig. 5)."""

    voxel: float = Field(0.1, gt=0, description="m, one point of the map per voxel: the mean of its points")
    max_range: float = Field(60.0, gt=0, description="m, points used")
    tile: float = Field(40.0, gt=0, description="m, side of the squares in which the map is made and written")
    picture_pixels: int = Field(3000, ge=16, le=20000, description="pixels of the pictures' longer side, at most")


class OutputSettings(_Group):
    """What is written per point."""

    confidence: bool = Field(False, description="write confidences/, how sure each point's label is")

    track_ids: bool = Field(False, description="write the track's number into the upper 16 bits of moving points")


class ImageSettings(_Group):
    """III-E: the range image that the network sees."""

    height: int = Field(64, ge=16, multiple_of=16, description="rows; a sensor's beams are shared out among them")
    width: int = Field(2048, ge=16, multiple_of=16, description="columns")
    residuals: int = Field(8, ge=0, description="residual images, one each for as many earlier scans")
    spacing: float = Field(0.1, gt=0, description="s between the scans of successive residual images")
    residual_min_range: float = Field(2.0, ge=0, description="m, nearer points have no residual")
    residual_max_range: float = Field(50.0, gt=0, description="m, points further away have no residual")


class ModelSettings(_Group):
    """The network's shape."""

    name: Literal["salsanext", "rangenet"] = "salsanext"
    channels: int = Field(32, ge=4, multiple_of=4, description="of the first layer; 32 is full size, 8 narrow")
    dropout: float = Field(0.2, ge=0, lt=1, description="share of channels left out while training")


class AugmentationSettings(_Group):
    """Changes of the world that should change no label, each with its probability."""

    turn: float = Field(1.0, ge=0, le=1, description="probability of a turn about the vertical by any angle")
    mirror: float = Field(0.5, ge=0, le=1, description="probability of exchanging left and right")
    shift: float = Field(0.5, ge=0, le=1, description="probability of a shift")
    shift_x: float = Field(2.0, ge=0, description="m, at most")
    shift_y: float = Field(2.0, ge=0, description="m, at most")
    shift_z: float = Field(0.3, ge=0, description="m, at most")
    drop: float = Field(0.5, ge=0, le=1, description="probability of dropping points")
    max_dropped: float = Field(0.5, ge=0, lt=1, description="share of points dropped at most")
    no_intensity: float = Field(0.3, ge=0, le=1, description="probability of doing without intensities")


class TrainingSettings(_Group):
    """How the network learns (LMNet: SGD at 0.01, 150 epochs)."""

    epochs: int = Field(150, ge=1, description="at most")
    samples: int = Field(0, ge=0, description="scans an epoch, drawn anew each time; 0: every scan once")
    batch: int = Field(8, ge=1, description="scans a step and device")
    optimizer: Literal["adamw", "sgd"] = "adamw"
    learning_rate: float = Field(0.002, gt=0, description="at its highest")
    momentum: float = Field(0.9, ge=0, lt=1, description="of sgd")
    weight_decay: float = Field(1e-4, ge=0)
    warm_up: float = Field(1.0, ge=0, description="epochs until the learning rate is at its highest")
    schedule: Literal["cosine", "exponential"] = "cosine"
    decay: float = Field(0.99, gt=0, le=1, description="factor of the learning rate per epoch, if exponential")
    patience: int = Field(30, ge=1, description="epochs without a better validation until training stops")
    use_confidence: bool = Field(False, description="weigh every point's loss by the confidence of its label")
    validation_scans: int = Field(100, ge=1, description="scans an epoch is judged by, evenly spread")
    weighed_scans: int = Field(60, ge=1, description="scans in which classes are counted for their weights")
    keep: tuple[int, ...] = Field((), description="numbers of epochs after which the network is kept, in OUT/epochs")
    seed: int = Field(0, ge=0)
    loaders: int = Field(0, ge=0, description="processes that prepare scans; 0: the training process itself")
    cached_scans: int = Field(4000, ge=0, description="scans kept in memory, thinned to one point per pixel")


class CleanUpSettings(_Group):
    """From pixels back to points (RangeNet++)."""

    window: int = Field(5, ge=1, le=15, description="pixels, width and height of where voters are looked for")
    voters: int = Field(5, ge=1, description="pixels that vote on a point")
    sigma: float = Field(1.0, gt=0, description="pixels, how soon far voters count less")
    cutoff: float = Field(1.0, gt=0, description="m, pixels whose range differs by more do not vote")


class OnlineSettings(_Group):
    """The network on the robot."""

    engine: Literal["auto", "torch", "onnxruntime", "openvino"] = Field("auto", description="what runs the network")
    device: Literal["auto", "cpu", "gpu"] = "auto"
    threads: int = Field(0, ge=0, description="of the network on a CPU; 0: one per core")
    timing_scans: int = Field(16, ge=8, description="scans after which it is found out how sweeps are timed")
    pattern_points: int = Field(1000, ge=100, description="points a scan needs to show the sensor's beams")


class SelfTrainingSettings(_Group):
    """What a network says of each point, as a further cue for the labeler."""

    folder: str = Field("", description="probabilities/ of automos segment --probabilities; empty: no cue")
    weight: float = Field(0.5, ge=0, description="of the network's log-odds beside those of the evidence")
    most: float = Field(0.98, gt=0.5, lt=1, description="probability that the network is trusted with at most")


class SceneFlowSettings(_Group):
    """The rival that thresholds scene flow (IV-C)."""

    max_range: float = Field(50.0, gt=0, description="m, points further away count as static")
    min_height: float = Field(0.3, description="m above the ground under the first scan; lower points are static")
    neighbours: int = Field(16, ge=1, description="points whose median flow a point takes")
    min_speed: float = Field(1.4, gt=0, description="m/s from which on a point moves (SeFlow: 0.14 m a scan)")
    max_speed: float = Field(44.0, gt=0, description="m/s, faster is a point that appeared")


class NetworkSettings(_Group):
    """III-E: LMNet, online moving-object segmentation."""

    image: ImageSettings = ImageSettings()
    model: ModelSettings = ModelSettings()
    augmentation: AugmentationSettings = AugmentationSettings()
    training: TrainingSettings = TrainingSettings()
    cleanup: CleanUpSettings = CleanUpSettings()
    online: OnlineSettings = OnlineSettings()
    scene_flow: SceneFlowSettings = SceneFlowSettings()


class Settings(_Group):
    """All settings of one run."""

    odometry: OdometrySettings = OdometrySettings()
    candidates: CandidatesSettings = CandidatesSettings()
    instances: InstancesSettings = InstancesSettings()
    tracking: TrackingSettings = TrackingSettings()
    labels: LabelsSettings = LabelsSettings()
    output: OutputSettings = OutputSettings()
    network: NetworkSettings = NetworkSettings()
    self_training: SelfTrainingSettings = SelfTrainingSettings()
    baselines: BaselinesSettings = BaselinesSettings()
    map: MapSettings = MapSettings()


PRESETS: dict[str, dict[str, Any]] = {
    "paper": {
        "odometry": {"refine": False},
        "candidates": {"method": "erasor"},
        "instances": {"method": "hdbscan"},
        "tracking": {"method": "paper"},
    },
    "default": {},
}


def load_settings(
    preset: str = "default", file: str | Path | None = None, overrides: Mapping[str, Any] | None = None
) -> Settings:
    """Return the settings of `preset`, changed by a YAML `file`, then by `overrides` ("tracking.max_misses": 3).

    Raises
    ------
    SettingsError : an unknown preset or key (the nearest is named), a value of the wrong type or out of range.
    """
    if preset not in PRESETS:
        raise SettingsError(f"there is no preset '{preset}': choose one of {', '.join(PRESETS)}")
    tree = _merged(Settings().model_dump(), PRESETS[preset])  # groups of one kind differ in their defaults by place
    if file is not None:
        tree = _merged(tree, _read_yaml(Path(file)))
    for dotted, value in (overrides or {}).items():
        branch: Any = value
        for key in reversed(dotted.split(".")):
            branch = {key: branch}
        tree = _merged(tree, branch)
    try:
        return Settings.model_validate(tree)
    except ValidationError as error:
        raise SettingsError(_sentence(error)) from None


def read_overrides(items: Iterable[str] | None) -> dict[str, Any]:
    """Return the settings written as "tracking.max_misses=3", by their names; values are YAML's.

    Raises
    ------
    SettingsError : one of them has no value, or none that YAML understands.
    """
    values = {}
    for item in items or []:
        key, sign, text = item.partition("=")
        if not sign:
            raise SettingsError(f"--set {item} has no value: write --set {key}=VALUE")
        try:
            values[key.strip()] = yaml.safe_load(text)
        except yaml.YAMLError:
            raise SettingsError(
                f"--set {item}: '{text}' is no value: write a number, a word or a list, [1, 2]"
            ) from None
    return values


def dump_yaml(settings: Settings) -> str:
    """Return the settings as YAML that `load_settings` reads back."""
    return yaml.safe_dump(settings.model_dump(mode="json"), sort_keys=False)


def _merged(base: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    out = dict(base)
    for key, value in change.items():
        is_group = isinstance(value, Mapping) and isinstance(out.get(key, {}), Mapping)
        out[key] = _merged(out.get(key, {}), value) if is_group else value
    return out


def _read_yaml(file: Path) -> dict[str, Any]:
    try:
        tree = yaml.safe_load(file.read_text())
    except OSError as error:
        raise SettingsError(f"settings file {file} could not be read ({error.strerror}): check the path") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        why = " ".join(str(error).split())  # YAML's messages draw the place on lines of their own
        raise SettingsError(f"settings file {file} is not YAML ({why}): `automos settings` prints one") from None
    if not isinstance(tree, dict | None):
        raise SettingsError(f"settings file {file} must hold names and values: `automos settings` prints one")
    return tree or {}


def _sentence(error: ValidationError) -> str:
    """Return the first problem of `error` as a sentence that names the key, the value and the nearest known key."""
    problem = error.errors()[0]
    path = [str(part) for part in problem["loc"]]
    key = ".".join(path)
    if problem["type"] == "extra_forbidden":
        known = _keys(Settings)
        same_name = [k for k in known if (k.split(".")[0], k.rsplit(".", 1)[-1]) == (path[0], path[-1])]
        near = difflib.get_close_matches(key, same_name or known, 1, 0.0)[0]
        return f"there is no setting '{key}': did you mean '{near}'? (`automos settings` lists all)"
    return f"setting {key} = {problem['input']!r} is not possible: {problem['msg'].lower()}"


def _keys(group: type[BaseModel], prefix: str = "") -> list[str]:
    keys = []
    for name, field in group.model_fields.items():
        keys.append(prefix + name)
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            keys += _keys(field.annotation, f"{prefix}{name}.")
    return keys
