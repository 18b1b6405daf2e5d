"""IV-B: the methods that ours is compared with."""

from __future__ import annotations

from pydantic import Field

from automos.settings.group import Group


class BatchSettings(Group):
    """How map-based methods cut a recording: batches overlap, so what stands at the end of one is seen to leave."""

    scans: int = Field(200, ge=2, description="scans in one batch, at most")
    length: float = Field(160.0, gt=0, description="m driven in one batch, at most")


class OctomapSettings(Group):
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


class RemovertSettings(Group):
    """Removert (Kim and Kim, IROS 2020): remove at fine resolutions, revert at coarse ones."""

    batch: BatchSettings = BatchSettings(scans=150)
    voxel: float = Field(0.05, gt=0, description="m, of the map")
    max_range: float = Field(80.0, gt=0, description="m, points used")
    remove: tuple[float, ...] = Field((2.5, 2.0, 1.5), min_length=1, description="pixels per degree, one pass each")
    revert: tuple[float, ...] = Field((1.0, 0.9, 0.8, 0.7), description="pixels per degree, one pass each; none: off")
    every: int = Field(5, ge=1, description="every how many scans the map is compared with")
    max_elevation_deg: float = Field(25.0, gt=0, le=90, description="deg above and below the sensor that is looked at")
    difference: float = Field(0.05, gt=0, description="of the range, by which the map must be nearer than the scan")


class YoonSettings(Group):
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


class PfreundschuhSettings(Group):
    """Pfreundschuh et al. (ICRA 2021) as Chen et al. ran it: Removert's visibility, voted on by HDBSCAN clusters."""

    min_cluster_size: int = Field(10, ge=2, description="voxels")
    voxel: float = Field(0.15, ge=0, description="m, points are clustered as voxels of this size; 0: as they are")
    max_range: float = Field(60.0, gt=0, description="m, points used")
    share: float = Field(0.3, gt=0, le=1, description="of a cluster's points that must have been seen through")


class DufomapSettings(Group):
    """DUFOMap (Duberg et al., RA-L 2024): the authors' library, its own names."""

    batch: BatchSettings = BatchSettings()
    resolution: float = Field(0.1, gt=0, description="m, voxel")
    d_s: float = Field(0.2, ge=0, description="m, hits are inflated by")
    d_p: int = Field(2, ge=0, description="voxels, the unknown is inflated by")
    min_range: float = Field(0.2, gt=0, description="m; points at the sensor itself poison its map")
    max_range: float = Field(50.0, gt=0, description="m, points used")


class AlongRaySettings(Group):
    """M-detector's cases 2 and 3: what goes away along a ray, or comes nearer, twice and about as fast."""

    width: float = Field(0.01, gt=0, description="rad, half of it; the same direction")
    height: float = Field(gt=0, description="rad, half of it; the same direction")
    depth: float = Field(ge=0, description="m from a point to what hides it, at least")
    share: float = Field(ge=0, description="of the range, added to it")
    reach: float = Field(gt=0, description="m from a point to what hides it, at most")
    min_speed: float = Field(gt=0, description="m/s")
    max_acceleration: float = Field(gt=0, description="m/s^2")
    stands_width: float = Field(0.01, gt=0, description="rad, half of it; where what stood is looked for")
    stands_height: float = Field(gt=0, description="rad, half of it; likewise")
    tolerance: float = Field(0.2, gt=0, description="m, what lies as near to something that stood stands")
    even_window: float = Field(0.01, gt=0, description="rad, half its side; where a surface must not be slanted")
    even_depth: float = Field(gt=0, description="m by which the points there may differ on average")
    even_reach: float = Field(gt=0, description="m, points further off are of another surface")


class MDetectorSettings(Group):
    """M-detector (Wu et al., Nature Communications 2024): three tests of occlusion, then clusters.

    The values are the authors' for KITTI. A sensor whose rays lie further apart gets windows as much wider.
    """

    images: int = Field(15, ge=3, description="past depth images asked")
    gap: float = Field(0.1, gt=0, description="s between them")
    row: float = Field(0.007, gt=0, description="rad, pixel of a depth image in elevation")
    column: float = Field(0.005, gt=0, description="rad, pixel in azimuth")
    min_range: float = Field(2.0, ge=0, description="m, nearer points are no events: the vehicle itself")
    depth: float = Field(0.15, gt=0, description="m, case 1: what lies so much before an image hides it")
    hidden_images: int = Field(2, ge=1, description="images that something hides to be an event")
    stands_width: float = Field(0.01, gt=0, description="rad, half of it; where what stood is looked for")
    stands_height: float = Field(0.015, gt=0, description="rad, half of it; likewise")
    stands_metres: float = Field(0.15, ge=0, description="m, half of both, at least")
    tolerance: float = Field(0.15, gt=0, description="m, what lies as near to something that stood stands")
    surface_width: float = Field(0.015, gt=0, description="rad, half of it; corners of a surface that stood")
    surface_height: float = Field(0.007, gt=0, description="rad, half of it; likewise")
    surface_reach: float = Field(10.0, gt=0, description="m from a point to such corners, at most")
    surface_near: float = Field(0.5, gt=0, description="m, what lies as near to the surface stands; up to ...")
    surface_from: float = Field(10.0, ge=0, description="m, this range")
    surface_far: float = Field(0.5, gt=0, description="m, likewise beyond that range, and ...")
    surface_per_metre: float = Field(0.1, ge=0, description="m more for each metre beyond it")
    away: AlongRaySettings = AlongRaySettings(
        height=0.015,
        depth=0.0,
        share=0.005,
        reach=10.15,
        min_speed=1.0,
        max_acceleration=7.0,
        stands_height=0.01,
        even_depth=0.1,
        even_reach=0.5,
    )
    nearer: AlongRaySettings = AlongRaySettings(
        height=0.01,
        depth=0.15,
        share=0.0,
        reach=100.0,
        min_speed=0.5,
        max_acceleration=15.0,
        stands_height=0.008,
        even_depth=0.3,
        even_reach=1.0,
    )
    cluster_voxel: float = Field(0.3, gt=0, description="m")
    cluster_reach: int = Field(2, ge=1, description="voxels, over which events are of one cluster")
    cluster_voxels: int = Field(8, ge=1, description="voxels that make a cluster")
    cluster_share: float = Field(0.3, ge=0, le=1, description="of the objects' points in its box that are events")


class HmmMosSettings(Group):
    """HMM-MOS (Bhandari et al., 2024): a hidden Markov model per voxel, filtered in space and time."""

    batch: BatchSettings = BatchSettings()
    voxel: float = Field(0.25, gt=0, description="m")
    min_range: float = Field(0.5, ge=0, description="m, points used")
    max_range: float = Field(120.0, gt=0, description="m, points used")
    deviation: float = Field(0.25, gt=0, description="m, of a hit around the surface that caused it")
    change: float = Field(0.005, gt=0, lt=0.5, description="probability per scan that a voxel's state changes")
    sure: float = Field(0.99, gt=0.5, lt=1, description="probability from which on a state is believed")
    reach: int = Field(2, ge=0, description="voxels around, 2: 5 x 5 x 5, over which changes are summed")
    window: int = Field(3, ge=1, description="scans, likewise")
    min_sum: float = Field(3.0, ge=0, description="changes that make motion, at least; Otsu may ask for more")


class BaselinesSettings(Group):
    """IV-B: the methods that ours is compared with. ERASOR's settings are those of the candidates."""

    octomap: OctomapSettings = OctomapSettings()
    removert: RemovertSettings = RemovertSettings()
    yoon: YoonSettings = YoonSettings()
    pfreundschuh: PfreundschuhSettings = PfreundschuhSettings()
    dufomap: DufomapSettings = DufomapSettings()
    m_detector: MDetectorSettings = MDetectorSettings()
    hmm_mos: HmmMosSettings = HmmMosSettings()
