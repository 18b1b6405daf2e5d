"""One step of ERASOR: the comparison of a scan with the map, by polar bins, and the ground of a bin (R-GPF).

A bin is a few metres wide, so a plane fits its ground, unlike that of the whole scene.
"""

import numpy as np

from automos.core.kernels import kernel


@kernel
def fit_region_ground(points, seed_height, n_skipped, n_lowest, n_iterations, distance):  # type: ignore[no-untyped-def]
    """Return (N,) bool: which of one bin's `points` (N, 3, z up) are ground, by region-wise plane fit (R-GPF).

    The first seeds are the points less than `seed_height` above the mean height of the `n_lowest` lowest points after
    the `n_skipped` very lowest. Then a plane is fitted `n_iterations` times; the next seeds are the points nearer than
    `distance` to it or below it. The normal is oriented upwards; its sign is arbitrary in the released code.
    """
    n = len(points)
    is_ground = np.zeros(n, np.bool_)
    order = np.argsort(points[:, 2])
    skipped = min(n_skipped, max(n - 1, 0))
    last = min(skipped + n_lowest, n)
    lowest = 0.0
    for k in range(skipped, last):
        lowest += points[order[k], 2]
    lowest /= last - skipped
    for i in range(n):
        is_ground[i] = points[i, 2] < lowest + seed_height
    for _ in range(n_iterations):
        m = 0
        mean = np.zeros(3)
        for i in range(n):
            if is_ground[i]:
                m += 1
                for a in range(3):
                    mean[a] += points[i, a]
        if m < 3:
            break
        mean /= m
        covariance = np.zeros((3, 3))
        for i in range(n):
            if is_ground[i]:
                for a in range(3):
                    for c in range(3):
                        covariance[a, c] += (points[i, a] - mean[a]) * (points[i, c] - mean[c])
        if not np.isfinite(covariance).all():
            break
        normal = np.linalg.eigh(covariance)[1][:, 0]
        if normal[2] < 0.0:
            normal = -normal
        for i in range(n):
            height = 0.0
            for a in range(3):
                height += normal[a] * (points[i, a] - mean[a])
            is_ground[i] = height < distance
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


@kernel
def compare_bins(near, map_points, is_alive, was_scanned, stamp, scan_points, scan_ids, about):  # type: ignore[no-untyped-def]
    """Compare one scan with the map by bins; edit `is_alive` (V,) in place, return (M,) the scan's dynamic points."""
    n_bins = about.rings * about.sectors
    map_bins, scan_bins = polar_bins(map_points, about), polar_bins(scan_points, about)
    of_map = _heights_of_map(near, map_points, map_bins, is_alive, n_bins)
    of_scan = _heights_of_scan(scan_points, scan_bins, scan_ids, was_scanned, stamp, n_bins)
    decision = _decide(of_map, of_scan, about)
    _remove_above_ground(near, map_points, map_bins, decision, is_alive, was_scanned, stamp, about.plane)
    rejected = np.zeros(len(scan_points), np.bool_)
    if about.version == 2:
        for i in range(len(scan_points)):
            b = scan_bins[i]
            if b < 0 or scan_ids[i] < 0:
                continue
            if decision[b] == _SCAN_HIGHER:
                rejected[i] = of_scan[1][b] > about.bin_max_height
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
def _decide(of_map, of_scan, about):  # type: ignore[no-untyped-def]
    """Return (B,) int8, the decision on each bin, from the ratio of the shorter height span to the longer."""
    map_low, map_high, map_count = of_map
    scan_low, scan_high, scan_count = of_scan
    decision = np.full(len(map_low), _KEEP, np.int8)
    for b in range(len(decision)):
        if scan_count[b] < about.min_points:
            continue
        if map_count[b] == 0:
            decision[b] = _SCAN_ONLY
            continue
        map_span, scan_span = map_high[b] - map_low[b], scan_high[b] - scan_low[b]
        longer = max(map_span, scan_span)
        if longer <= 0.0 or min(map_span, scan_span) / longer >= about.scan_ratio:
            decision[b] = _SIMILAR
        elif map_span < scan_span:
            decision[b] = _SCAN_HIGHER
        elif (about.version == 2 and map_high[b] > about.bin_max_height) or (
            about.version == 3 and map_span > about.min_removed_span
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
