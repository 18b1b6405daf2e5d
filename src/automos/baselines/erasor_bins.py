"""One step of ERASOR: the comparison of a scan with the map, by polar bins."""

from typing import NamedTuple

import numpy as np

from automos.baselines.region_ground import fit_region_ground
from automos.core.kernels import kernel

_KEEP, _MAP_HIGHER, _SCAN_HIGHER, _SIMILAR, _SCAN_ONLY = range(5)


class Volume(NamedTuple):
    """The bins around the sensor: range in metres, numbers of bins, heights in metres above the ground under it."""

    max_range: float
    rings: int
    sectors: int
    min_height: float
    max_height: float


class Rules(NamedTuple):
    """When a bin has changed; see `erasor.Parameters`."""

    version: int
    scan_ratio: float
    min_points: int
    bin_max_height: float
    min_removed_span: float
    plane: tuple[float, int, int, int, float]


@kernel
def polar_bins(points, volume):  # type: ignore[no-untyped-def]
    """Return (N,) int32 bin = ring * sectors + sector of `points` (N, 3, body frame), -1 outside the `Volume`."""
    bins = np.full(len(points), -1, np.int32)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r = np.sqrt(x * x + y * y)
        # NaN is outside
        if not (volume.min_height < z < volume.max_height and r <= volume.max_range):
            continue
        ring = min(int(r / volume.max_range * volume.rings), volume.rings - 1)
        angle = np.arctan2(y, x)
        if angle < 0.0:
            angle += 2.0 * np.pi
        sector = min(int(angle / (2.0 * np.pi) * volume.sectors), volume.sectors - 1)
        bins[i] = ring * volume.sectors + sector
    return bins


@kernel
def compare_bins(near, map_points, is_alive, was_scanned, stamp, scan_points, scan_ids, volume, rules):  # type: ignore[no-untyped-def]
    """Compare one scan with the map by bins; edit `is_alive` (V,) in place, return (M,) the scan's dynamic points."""
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


@kernel
def _heights_of_map(near, points, bins, is_alive, n_bins):  # type: ignore[no-untyped-def]
    """Return the lowest and highest point (B,) of the remaining map in each bin, and its number of voxels."""
    low, high, count = np.full(n_bins, np.inf), np.full(n_bins, -np.inf), np.zeros(n_bins, np.int64)
    for i in range(len(near)):
        b = bins[i]
        if b >= 0 and is_alive[near[i]]:
            low[b] = min(low[b], points[i, 2])
            high[b] = max(high[b], points[i, 2])
            count[b] += 1
    return low, high, count


@kernel
def _heights_of_scan(points, bins, ids, was_scanned, stamp, n_bins):  # type: ignore[no-untyped-def]
    """Return the same for a scan, counted in voxels like the map; mark these as scanned at `stamp`."""
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


@kernel
def _decide(of_map, of_scan, rules):  # type: ignore[no-untyped-def]
    """Return (B,) int8, the decision on each bin, from the ratio of the shorter height span to the longer."""
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


@kernel
def _remove_above_ground(near, map_points, map_bins, decision, is_alive, was_scanned, stamp, plane):  # type: ignore[no-untyped-def]
    """Remove the voxels above the ground plane of every bin decided _MAP_HIGHER from the map.

    Voxels that the scan hits, and the ground part of the map, remain.
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
