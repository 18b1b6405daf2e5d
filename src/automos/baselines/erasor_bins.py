"""One step of ERASOR: the comparison of a scan with the map, by polar bins, and the ground of a bin (R-GPF).

A bin is a few metres wide, so a plane fits its ground, unlike that of the whole scene.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from automos.baselines.brick_grid import Ids
from automos.core.kernels import kernel
from automos.core.scan import Mask


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


Plane = tuple[float, int, int, int, float]
"""Arguments of `fit_region_ground` after the points."""
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
    was_scanned: Ids,
    stamp: np.int32,
    scan_points: npt.NDArray,
    scan_ids: Ids,
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
    near: npt.NDArray[np.int64], points: npt.NDArray, bins: Ids, is_alive: Mask, is_hit: Mask, plane: Plane
) -> None:
    """Remove the voxels `near` (N,) above the ground plane of their bin, at `points`, from the map.

    Voxels that the scan hits, and the ground part of the map, remain.
    """
    order = np.argsort(bins, kind="stable")
    for members in np.split(order, np.flatnonzero(np.diff(bins[order])) + 1) if len(order) else []:
        above = near[members[~fit_region_ground(points[members], *plane)]]
        is_alive[above[~is_hit[above]]] = False
