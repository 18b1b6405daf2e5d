"""III-A: poses of every scan, refinement over longer baselines, loop closure."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class RefineSettings(Group):
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
    overhead: float = Field(2.7, description="m above the sensor along its z axis, where no vehicle reaches")
    overhead_weight: float = Field(4.0, ge=1, description="of what is so high, in the search for the speed")
    speed_rounds: int = Field(5, ge=1, description="searches, each from the poses that the one before has found")
    speed_prior: float = Field(0.2, ge=0, description="of a full score, that the registration's own speed has ahead")
    reverse_cost: float = Field(0.3, ge=0, description="of a full score, that going backwards has behind")
    speed_gain: float = Field(0.2, gt=0, lt=1, description="share by which another speed must explain more")
    acceleration_cost: float = Field(
        0.3, ge=0, description="share that an acceleration of max_acceleration must explain"
    )
    min_speed_ratio: float = Field(0.8, gt=0, le=1, description="of true speed to first estimate, at least")
    min_clear_speed: float = Field(2.0, gt=0, description="m/s, slower first estimates may be a mistaken standstill")
    standstill_share: float = Field(
        0.25,
        gt=0,
        lt=1,
        description="of what is overhead and faces along the way, found where it was by one who stands",
    )
    standstill_share_low: float = Field(
        0.1, gt=0, lt=1, description="of all that faces along the way, the same where nothing is overhead"
    )
    near_share: float = Field(
        0.5, gt=0, le=1, description="of what faces along the way, found again from nearly the same place"
    )
    near_view: float = Field(1.5, gt=0, description="m over which this falls to a third")
    min_step: float = Field(0.1, gt=0, description="m, shorter steps have no direction")
    min_straightness: float = Field(
        0.8, gt=0, lt=1, description="how much steps agree on their direction in the sensor's frame"
    )
    body_range: float = Field(6.0, ge=0, description="m within which the vehicle's own body is looked for")
    body_voxel: float = Field(0.4, gt=0, description="m")
    body_share: float = Field(0.8, gt=0, le=1, description="share of scans that must see it at the same place")
    body_spread: float = Field(0.04, gt=0, description="m, deviation of that place")


class LoopSettings(Group):
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


class OdometrySettings(Group):
    """III-A: poses of every scan."""

    voxel: float | None = Field(None, gt=0, description="m, local map voxel; none: a hundredth of max_range")
    max_range: float = Field(100.0, gt=0, le=20_000, description="m, points used for registration")
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
    time: Literal["auto", "file", "order", "azimuth", "none"] = Field(
        "auto",
        description="where the points' times come from for motion compensation: the file, the order of the points, "
        "their azimuth, or none (already compensated); auto finds out under which of them the scans fit together best",
    )
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
