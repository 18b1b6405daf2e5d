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


class MDetectorSettings(Group):
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


class HmmMosSettings(Group):
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


class BaselinesSettings(Group):
    """IV-B: the methods that ours is compared with. ERASOR's settings are those of the candidates."""

    octomap: OctomapSettings = OctomapSettings()
    removert: RemovertSettings = RemovertSettings()
    yoon: YoonSettings = YoonSettings()
    pfreundschuh: PfreundschuhSettings = PfreundschuhSettings()
    dufomap: DufomapSettings = DufomapSettings()
    m_detector: MDetectorSettings = MDetectorSettings()
    hmm_mos: HmmMosSettings = HmmMosSettings()
