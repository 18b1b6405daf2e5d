"""ERASOR: a bin that reaches much higher in the map than in a scan contained an object that left.

Our reading of Lim, Hwang and Myung, "ERASOR: Egocentric Ratio of Pseudo Occupancy-Based Dynamic Object Removal for
Static 3D Point Cloud Map Building" (RA-L 2021), paper III-B of Chen et al. The scans of one submap are aggregated into
voxels. Around each scan, map and scan are divided into polar bins. Where the ratio of their height spans ("pseudo
occupancy") is small, the bin's voxels above a plane fitted to its lowest part (R-GPF) are removed from the map. A point
moves if its voxel was removed. The map is edited in place: later scans are compared with a cleaner map.

A step compares a scan with the map, by polar bins. A bin is a few metres wide, so a plane fits its ground (R-GPF),
unlike that of the whole scene.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from automos.baselines.batches import BATCH, BatchSize, add_used, body_of, cut_batches, labels_of_voxels
from automos.core.geometry import inverse, transform
from automos.core.kernels import kernel
from automos.core.scan import Frame, Frames, Mask
from automos.core.voxel_map import VoxelMap


class Parameters(NamedTuple):
    """As in the authors' large_scale.yaml, their preset for whole sequences.

    Attributes
    ----------
    version : int
        2: the paper's rule; 3: the released rule, which removes less.
    voxel : float
        Metres, side of the map's voxels.
    max_range : float
        Metres, radius of the volume of interest.
    rings, sectors : int
        Numbers of its bins.
    min_height, max_height : float
        Metres above the ground under the sensor, between which it lies.
    scan_ratio : float
        Of the height spans of scan and map, below which a bin has changed.
    min_points : int
        Least number of scan voxels in a bin that is compared.
    bin_max_height : float
        Metres, version 2: a removed bin must reach higher than this.
    min_removed_span : float
        Metres, version 3: a removed bin must span more than this.
    plane : tuple
        Arguments of R-GPF, see `fit_region_ground`.
    ego_radius : float
        Metres; nearer points are the ego body.
    every : int
        Scans per comparison with the map.
    batch : BatchSize
        Of a submap.
    """

    version: int = 3
    voxel: float = 0.2
    max_range: float = 80.0
    rings: int = 20
    sectors: int = 108
    min_height: float = -1.3
    max_height: float = 3.0
    scan_ratio: float = 0.2
    min_points: int = 6
    bin_max_height: float = 0.2
    min_removed_span: float = 0.5
    plane: tuple[float, int, int, int, float] = (0.5, 5, 20, 3, 0.25)
    ego_radius: float = 2.7
    every: int = 4
    batch: BatchSize = BATCH


def find_moving(frames: Frames, parameters: Parameters, start: int = 0) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool) of every frame from `start` on, in order: the points whose voxel ERASOR removed.

    frames : Frames, of a recording.   start : int, index of the first frame to return.
    """
    for submap, own in cut_batches(frames, parameters.batch, start):
        yield from zip(own, clean_submap(frames, submap, own, parameters), strict=True)


def clean_submap(frames: Frames, submap: range, own: range, parameters: Parameters) -> Iterator[Mask]:
    """Yield for each frame in `own` which of its points (M,) had their voxel removed.

    submap : range, the frames that make the map and are compared with it.
    """
    T_body_sensor = body_of(frames)
    voxels = VoxelMap(parameters.voxel, frames.T_level_sensor[submap[0], :3, 3])
    ids_of = [_add_beside_body(voxels, frames[k], parameters.ego_radius) for k in submap]
    mean = voxels.mean
    is_alive = np.ones(len(mean), bool)
    was_scanned = np.full(len(mean), -1, np.int32)
    rejected: dict[int, Mask] = {}
    for k in submap[:: parameters.every]:
        frame, ids = frames[k], ids_of[k - submap[0]]
        away = mean[:, :2] - frame.origin_level[:2].astype(np.float32)
        near = np.flatnonzero(np.einsum("ij,ij->i", away, away) <= np.float32(parameters.max_range) ** 2)
        of_map = transform(T_body_sensor @ inverse(frame.T_level_sensor), mean[near])
        of_scan = transform(T_body_sensor, frame.points)
        rejected[k] = compare_bins(near, of_map, is_alive, was_scanned, np.int32(k), of_scan, ids, parameters)
    for k in own:
        yield labels_of_voxels(ids_of[k - submap[0]], ~is_alive) | rejected.get(k, False)


def _add_beside_body(voxels: VoxelMap, frame: Frame, ego_radius: float) -> npt.NDArray[np.int32]:
    level = frame.points[:, :2]
    return add_used(voxels, frame, np.einsum("ij,ij->i", level, level) > ego_radius**2)


@kernel
def fit_region_ground(points, seed_height, n_skipped, n_lowest, n_iterations, distance):  # type: ignore[no-untyped-def]
    """Return (N,) bool: which of one bin's `points` (N, 3, z up) are ground, by region-wise plane fit (R-GPF).

    The first seeds are the points less than `seed_height` above the mean height of the `n_lowest` lowest points after
    the `n_skipped` very lowest. Then a plane is fitted `n_iterations` times; the next seeds are the points nearer than
    `distance` to it or below it. The normal is oriented upwards; its sign is arbitrary in the released code.
    """
    skipped = min(n_skipped, max(len(points) - 1, 0))
    lowest = np.sort(points[:, 2])[skipped : skipped + n_lowest].astype(np.float64).mean()
    is_ground = points[:, 2] < lowest + seed_height
    for _ in range(n_iterations):
        ground = points[is_ground].astype(np.float64)
        if len(ground) < 3:
            break
        mean = np.array([ground[:, a].mean() for a in range(3)])
        away, covariance = ground - mean, np.empty((3, 3))
        for a in range(3):
            for c in range(3):
                covariance[a, c] = (away[:, a] * away[:, c]).sum()
        if not np.isfinite(covariance).all():
            break
        normal = np.linalg.eigh(covariance)[1][:, 0]
        if normal[2] < 0.0:
            normal = -normal
        away = points - mean
        is_ground = away[:, 0] * normal[0] + away[:, 1] * normal[1] + away[:, 2] * normal[2] < distance
    return is_ground


_KEEP, _MAP_HIGHER, _SCAN_HIGHER, _SIMILAR, _SCAN_ONLY = range(5)


@kernel
def polar_bins(points, about):  # type: ignore[no-untyped-def]
    """Return (N,) int32 bin = ring * sectors + sector of `points` (N, 3, body frame), -1 outside all.

    about : `erasor.Parameters`, as everywhere here.
    """
    bins = np.full(len(points), -1, np.int32)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r = np.sqrt(x * x + y * y)
        # NaN is outside
        if not (about.min_height < z < about.max_height and r <= about.max_range):
            continue
        ring = min(int(r / about.max_range * about.rings), about.rings - 1)
        angle = np.arctan2(y, x)
        if angle < 0.0:
            angle += 2.0 * np.pi
        sector = min(int(angle / (2.0 * np.pi) * about.sectors), about.sectors - 1)
        bins[i] = ring * about.sectors + sector
    return bins


class _Heights(NamedTuple):
    """Of the points in each bin (B,): the lowest and the highest, and how many voxels they lie in."""

    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]
    n_voxels: npt.NDArray[np.int64]


def compare_bins(
    near: npt.NDArray[np.int64],
    map_points: npt.NDArray,
    is_alive: Mask,
    was_scanned: npt.NDArray[np.int32],
    stamp: np.int32,
    scan_points: npt.NDArray,
    scan_ids: npt.NDArray[np.int32],
    about: Any,
) -> Mask:
    """Compare one scan with the map by bins; edit `is_alive` (V,) in place, return (M,) the scan's dynamic points."""
    n_bins = about.rings * about.sectors
    map_bins = np.where(is_alive[near], polar_bins(map_points, about), -1)
    scan_bins = np.where(scan_ids >= 0, polar_bins(scan_points, about), -1)
    of_map = _Heights(*_measure(map_points, map_bins, near, np.full_like(was_scanned, -1), stamp, n_bins))
    of_scan = _Heights(*_measure(scan_points, scan_bins, scan_ids, was_scanned, stamp, n_bins))
    decision = np.append(_decide(of_map, of_scan, about), _KEEP)  # bin -1 reads the one at the end
    rows = np.flatnonzero(decision[map_bins] == _MAP_HIGHER)
    _remove_above_ground(near[rows], map_points[rows], map_bins[rows], is_alive, was_scanned == stamp, about.plane)
    if about.version != 2:
        return np.zeros(len(scan_points), bool)
    is_back = np.isin(decision, (_SIMILAR, _SCAN_ONLY))[scan_bins]
    is_alive[scan_ids[is_back]] = True
    return (decision[scan_bins] == _SCAN_HIGHER) & (of_scan.high[scan_bins] > about.bin_max_height)


@kernel
def _measure(points, bins, voxels, was_met, stamp, n_bins):  # type: ignore[no-untyped-def]
    """Return the `_Heights` of points in `voxels` (N,); mark these as met at `stamp`."""
    low, high, count = np.full(n_bins, np.inf), np.full(n_bins, -np.inf), np.zeros(n_bins, np.int64)
    for i in range(len(points)):
        b, v = bins[i], voxels[i]
        if b >= 0:
            low[b] = min(low[b], points[i, 2])
            high[b] = max(high[b], points[i, 2])
            count[b] += was_met[v] != stamp
            was_met[v] = stamp
    return low, high, count


def _decide(of_map: _Heights, of_scan: _Heights, about: Any) -> npt.NDArray[np.int64]:
    """Return (B,), the decision on each bin, from the ratio of the shorter height span to the longer."""
    map_span, scan_span = of_map.high - of_map.low, of_scan.high - of_scan.low
    longer = np.maximum(map_span, scan_span)
    with np.errstate(invalid="ignore", divide="ignore"):  # bins that are empty or flat
        is_similar = (longer <= 0.0) | (np.minimum(map_span, scan_span) / longer >= about.scan_ratio)
    stands_out = of_map.high > about.bin_max_height if about.version == 2 else map_span > about.min_removed_span
    is_unknown = of_scan.n_voxels < about.min_points
    cases = (is_unknown, of_map.n_voxels == 0, is_similar, map_span < scan_span, stands_out)
    return np.select(cases, (_KEEP, _SCAN_ONLY, _SIMILAR, _SCAN_HIGHER, _MAP_HIGHER), _KEEP)


def _remove_above_ground(
    near: npt.NDArray[np.int64],
    points: npt.NDArray,
    bins: npt.NDArray[np.int32],
    is_alive: Mask,
    is_hit: Mask,
    plane: tuple[float, int, int, int, float],
) -> None:
    """Remove the voxels `near` (N,) above the ground plane of their bin, at `points`, from the map.

    Voxels that the scan hits, and the ground part of the map, remain.
    """
    order = np.argsort(bins, kind="stable")
    for members in np.split(order, np.flatnonzero(np.diff(bins[order])) + 1) if len(order) else []:
        above = near[members[~fit_region_ground(points[members], *plane)]]
        is_alive[above[~is_hit[above]]] = False
