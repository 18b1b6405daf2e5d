"""ERASOR: a bin of the map that reaches much higher than the same bin of a scan held something that left.

Our reading of Lim, Hwang and Myung, "ERASOR: Egocentric Ratio of Pseudo Occupancy-Based Dynamic Object Removal for
Static 3D Point Cloud Map Building" (RA-L 2021), paper III-B of Chen et al. The scans of one submap are aggregated into
voxels; around each scan, map and scan are cut into polar bins; where the ratio of their height spans ("pseudo
occupancy") is small, the bin's voxels above a plane fitted to its lowest part (R-GPF) leave the map. A scan's point is
a candidate if its voxel left the map. The map is edited in place: later scans meet an already cleaner map.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from automos.candidates.region_ground import fit_region_ground
from automos.candidates.voxel_map import VoxelMap
from automos.geometry import inverse, transform
from automos.scan import Frames
from automos.settings import ErasorSettings

_KEEP, _MAP_HIGHER, _SCAN_HIGHER, _SIMILAR, _SCAN_ONLY = range(5)


class Published(NamedTuple):
    """What no setting changes: as in the authors' large_scale_05.yaml, alike in all of their configurations.

    Attributes
    ----------
    rings, sectors : bins of the volume of interest.
    min_points : voxels of a scan that a bin needs to be compared.
    bin_max_height : metres, version 2: a removed bin must reach higher than this.
    min_removed_span : metres, version 3: a removed bin must span more than this.
    plane : R-GPF's arguments, see `fit_region_ground`.
    ego_radius : metres; nearer points are the vehicle itself.
    submap_scans, submap_length : scans, metres driven; ours: they bound memory, and are longer than a car is in sight.
    """

    rings: int = 20
    sectors: int = 108
    min_points: int = 6
    bin_max_height: float = 0.2
    min_removed_span: float = 0.5
    plane: tuple[float, int, int, int, float] = (0.5, 5, 20, 3, 0.25)
    ego_radius: float = 2.7
    submap_scans: int = 200
    submap_length: float = 160.0


PUBLISHED = Published()


class Volume(NamedTuple):
    """The bins around the sensor: metres, numbers, metres above the ground under it."""

    max_range: float
    rings: int
    sectors: int
    min_height: float
    max_height: float


class Rules(NamedTuple):
    """When a bin has changed; see `ErasorSettings` and `Published`."""

    version: int
    scan_ratio: float
    min_points: int
    bin_max_height: float
    min_removed_span: float
    plane: tuple[float, int, int, int, float]


def find_candidates(
    frames: Frames, settings: ErasorSettings, start: int = 0, published: Published = PUBLISHED
) -> Iterator[tuple[int, npt.NDArray[np.float32]]]:
    """Yield (index, score) of every frame from `start` on, in order.

    Parameters
    ----------
    frames : the frames of a recording.
    start : first index wanted (earlier ones were already made).

    Yields
    ------
    index and (M,) float32 score of each of the frame's points: 1 where ERASOR removed its voxel, else 0.
    """
    origins = frames.T_level_sensor[:, :3, 3]
    for first, last, own_first, own_last in cut_submaps(origins, published.submap_scans, published.submap_length):
        if own_last > start:
            own = range(max(own_first, start), own_last)
            yield from zip(own, clean_submap(frames, range(first, last), own, settings, published), strict=True)


def cut_submaps(origins: npt.NDArray, max_scans: int, max_length: float) -> list[tuple[int, int, int, int]]:
    """Return submaps as rows (first, last, own_first, own_last), half-open scan ranges.

    The own ranges tile the recording; a submap reaches further on both sides, so that something standing at the end
    of an own range is still seen to leave. Both scans and metres are bounded: a parked car records thousands of scans
    in one place, a motorway drive leaves a place within seconds.

    origins : (N, 3) metres, sensor positions.   max_scans, max_length : of one submap; metres driven.
    """
    n = len(origins)
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(origins, axis=0), axis=1))])[:n]
    submaps = []
    own_first = 0
    half_scans, half_length = max_scans // 2, max_length / 2
    while own_first < n:
        own_last = int(np.searchsorted(travelled, travelled[own_first] + half_length, side="right"))
        own_last = min(own_last, own_first + half_scans, n)
        if n - own_last < half_scans // 2 and travelled[-1] - travelled[own_last - 1] < half_length / 2:
            own_last = n  # no sliver at the end
        reach_back = int(np.searchsorted(travelled, travelled[own_first] - half_length / 2))
        reach_on = int(np.searchsorted(travelled, travelled[own_last - 1] + half_length / 2, side="right"))
        first = max(reach_back, own_first - half_scans // 2, 0)
        last = min(reach_on, own_last + half_scans // 2, n)
        submaps.append((first, last, own_first, own_last))
        own_first = own_last
    return submaps


def clean_submap(
    frames: Frames, submap: range, own: range, settings: ErasorSettings, published: Published = PUBLISHED
) -> Iterator[npt.NDArray[np.float32]]:
    """Yield for each frame in `own` the (M,) float32 score of its points: 1 where the cleaned map lost their voxel.

    submap : the frames that make the map and are compared with it.
    """
    # z up at the sensor's mount, ground under the vehicle at z = 0: heights are measured above what it stands on.
    T_body_sensor = frames.T_level_sensor[0].copy()
    T_body_sensor[:2, 3] = 0.0
    voxels = VoxelMap(settings.voxel, frames.T_level_sensor[submap[0], :3, 3])
    ids_of = []
    for k in submap:
        frame = frames[k]
        ids = np.full(len(frame.points), -1, np.int32)
        is_outside = np.einsum("ij,ij->i", frame.points[:, :2], frame.points[:, :2]) > published.ego_radius**2
        ids[is_outside] = voxels.add(frame.points_level[is_outside])
        ids_of.append(ids)

    mean = voxels.mean
    is_alive = np.ones(len(mean), bool)
    was_scanned = np.full(len(mean), -1, np.int32)
    rejected: dict[int, npt.NDArray[np.bool_]] = {}
    for k in submap[:: settings.every]:
        frame, ids = frames[k], ids_of[k - submap[0]]
        near = _voxels_near(mean, frame.origin_level.astype(np.float32), np.float32(settings.max_range))
        rejected[k] = _compare(
            near,
            transform(T_body_sensor @ inverse(frame.T_level_sensor), mean[near]),
            is_alive,
            was_scanned,
            np.int32(k),
            transform(T_body_sensor, frame.points),
            ids,
            *_for_kernel(settings, published),
        )
    for k in own:
        ids = ids_of[k - submap[0]]
        is_candidate = (ids >= 0) & ~np.append(is_alive, True)[ids]  # id -1 reads the True at the end
        if k in rejected:
            is_candidate |= rejected[k]
        yield is_candidate.astype(np.float32)


def _for_kernel(settings: ErasorSettings, published: Published) -> tuple[Volume, Rules]:
    return (
        Volume(settings.max_range, published.rings, published.sectors, settings.min_height, settings.max_height),
        Rules(settings.version, settings.scan_ratio, *published[2:6]),
    )


@numba.njit(cache=True, nogil=True)
def _voxels_near(mean, origin, max_range):  # type: ignore[no-untyped-def]
    near = np.empty(len(mean), np.int64)
    n = 0
    for v in range(len(mean)):
        dx, dy = mean[v, 0] - origin[0], mean[v, 1] - origin[1]
        if dx * dx + dy * dy <= max_range * max_range:
            near[n] = v
            n += 1
    return near[:n]


@numba.njit(cache=True, nogil=True)
def polar_bins(points, volume):  # type: ignore[no-untyped-def]
    """Return (N,) int32 bin = ring * sectors + sector of `points` (N, 3, body frame), -1 outside the `Volume`."""
    bins = np.full(len(points), -1, np.int32)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r = np.sqrt(x * x + y * y)
        # what is no number is outside
        if not (volume.min_height < z < volume.max_height and r <= volume.max_range):
            continue
        ring = min(int(r / volume.max_range * volume.rings), volume.rings - 1)
        angle = np.arctan2(y, x)
        if angle < 0.0:
            angle += 2.0 * np.pi
        sector = min(int(angle / (2.0 * np.pi) * volume.sectors), volume.sectors - 1)
        bins[i] = ring * volume.sectors + sector
    return bins


@numba.njit(cache=True, nogil=True)
def _compare(near, map_points, is_alive, was_scanned, stamp, scan_points, scan_ids, volume, rules):  # type: ignore[no-untyped-def]
    """Compare one scan with the map, bin by bin; edit `is_alive` (V,) in place, return (M,) the scan's own dynamics."""
    n_bins = volume.rings * volume.sectors
    map_bins, scan_bins = polar_bins(map_points, volume), polar_bins(scan_points, volume)
    of_map = _heights_of_map(near, map_points, map_bins, is_alive, n_bins)
    of_scan = _heights_of_scan(scan_points, scan_bins, scan_ids, was_scanned, stamp, n_bins)
    decision = _decide(of_map, of_scan, rules)
    _remove_above_ground(near, map_points, map_bins, decision, is_alive, was_scanned, stamp, rules.plane)
    rejected = np.zeros(len(scan_points), np.bool_)
    if rules.version == 2:
        for i in range(len(scan_points)):
            b = scan_bins[i]
            if b < 0 or scan_ids[i] < 0:
                continue
            if decision[b] == _SCAN_HIGHER:
                rejected[i] = of_scan[1][b] > rules.bin_max_height
            elif decision[b] == _SIMILAR or decision[b] == _SCAN_ONLY:
                is_alive[scan_ids[i]] = True
    return rejected


@numba.njit(cache=True, nogil=True)
def _heights_of_map(near, points, bins, is_alive, n_bins):  # type: ignore[no-untyped-def]
    """Return lowest and highest point (B,) of what is left of the map in each bin, and how many voxels that is."""
    low, high, count = np.full(n_bins, np.inf), np.full(n_bins, -np.inf), np.zeros(n_bins, np.int64)
    for i in range(len(near)):
        b = bins[i]
        if b >= 0 and is_alive[near[i]]:
            low[b] = min(low[b], points[i, 2])
            high[b] = max(high[b], points[i, 2])
            count[b] += 1
    return low, high, count


@numba.njit(cache=True, nogil=True)
def _heights_of_scan(points, bins, ids, was_scanned, stamp, n_bins):  # type: ignore[no-untyped-def]
    """Return the same of a scan, counted in voxels as the map is; mark these as scanned at `stamp`."""
    low, high, count = np.full(n_bins, np.inf), np.full(n_bins, -np.inf), np.zeros(n_bins, np.int64)
    for i in range(len(points)):
        b = bins[i]
        if b >= 0 and ids[i] >= 0:
            low[b] = min(low[b], points[i, 2])
            high[b] = max(high[b], points[i, 2])
            if was_scanned[ids[i]] != stamp:
                was_scanned[ids[i]] = stamp
                count[b] += 1
    return low, high, count


@numba.njit(cache=True, nogil=True)
def _decide(of_map, of_scan, rules):  # type: ignore[no-untyped-def]
    """Return (B,) int8, what became of each bin: by the ratio of the shorter span of heights to the longer."""
    map_low, map_high, map_count = of_map
    scan_low, scan_high, scan_count = of_scan
    decision = np.full(len(map_low), _KEEP, np.int8)
    for b in range(len(decision)):
        if scan_count[b] < rules.min_points:
            continue
        if map_count[b] == 0:
            decision[b] = _SCAN_ONLY
            continue
        map_span, scan_span = map_high[b] - map_low[b], scan_high[b] - scan_low[b]
        longer = max(map_span, scan_span)
        if longer <= 0.0 or min(map_span, scan_span) / longer >= rules.scan_ratio:
            decision[b] = _SIMILAR
        elif map_span < scan_span:
            decision[b] = _SCAN_HIGHER
        elif (rules.version == 2 and map_high[b] > rules.bin_max_height) or (
            rules.version == 3 and map_span > rules.min_removed_span
        ):
            decision[b] = _MAP_HIGHER
    return decision


@numba.njit(cache=True, nogil=True)
def _remove_above_ground(near, map_points, map_bins, decision, is_alive, was_scanned, stamp, plane):  # type: ignore[no-untyped-def]
    """Take the voxels above the ground plane of every bin decided _MAP_HIGHER out of the map.

    The bin becomes the scan's points and the ground part of the map's: voxels that the scan hits stay.
    """
    start = np.zeros(len(decision) + 1, np.int64)
    for i in range(len(near)):
        b = map_bins[i]
        if b >= 0 and decision[b] == _MAP_HIGHER and is_alive[near[i]]:
            start[b + 1] += 1
    start = np.cumsum(start)
    rows = np.empty(start[-1], np.int64)
    fill = start.copy()
    for i in range(len(near)):
        b = map_bins[i]
        if b >= 0 and decision[b] == _MAP_HIGHER and is_alive[near[i]]:
            rows[fill[b]] = i
            fill[b] += 1
    for b in range(len(decision)):
        if start[b + 1] == start[b]:
            continue
        members = rows[start[b] : start[b + 1]]
        is_ground = fit_region_ground(map_points[members], *plane)
        for j in range(len(members)):
            v = near[members[j]]
            if not is_ground[j] and was_scanned[v] != stamp:
                is_alive[v] = False
