"""The ego body: points that keep their place in the sensor's frame while the sensor moves.

A ray that meets the body returns the same range in every scan. So may a ray that meets an even road, a vehicle that
keeps its distance, or the long side of one that drives alongside. But other scans hit the road at its place and not the
body: a ray that passes through the place of a point is a vote for the body, one that ends there is a vote for the
world, and one that meets a possible body counts for neither. Whoever passes before it moves, and has no vote. Motion of
a few decimetres, or the rolling of a boat at its quay, suffices. Where there are no votes (inside a wide deck, before
water) those on the rest of a part decide. No vehicle keeps its distance to within the sensor's noise: the edges and
ranges of the body must be the same in the last third of the recording as in the first. Repeated returns from within
arm's reach (legs, an operator) are ego body, however they move, and so is a part that begins there, however it swings.
What is connected to the body belongs to it (`on_body`). While the sensor stands still none of this is observable, which
does no harm: objects that never move are static.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from automos.core.arrays import Items, evenly_spread
from automos.core.beam_pattern import BeamPattern, EgoBody, Lidar, directions
from automos.core.directions import last_looks, motion_of, raw_points
from automos.core.geometry import Array, inverse, se3_log, transform
from automos.core.range_image import NO_RAY, UNIT, RangeImage, make_image, over_neighbours, project
from automos.core.scan import Frame, Mask, Points, Pose
from automos.evidence.ground import find_ground
from automos.evidence.look_through import EDGE, HIT, look_through, tolerances_of
from automos.evidence.on_body import cells_within, extent_in, extent_in_most, parts_of
from automos.settings import CandidatesSettings, EgoBodySettings, FreeSpaceSettings

Ranges = npt.NDArray[np.float32]
MIN_SCANS, MAX_SCANS = 9, 40
"""With fewer scans at different poses, no body is detected; of more, so many, spread evenly, are evaluated."""
MIN_STEP, ARM = 0.25, 5.0
"""Metres: least displacement, between evaluated scans, of a point `ARM` from the sensor and fixed to it."""
GRAZING = 0.15
"""Share of a range by which that of the next ray may differ on a face met at a grazing angle; more is an edge."""
NEAR_SHARE, NEAR_MARGIN = 0.15, np.float32(0.1)
"""Least share of scans that return from within arm's reach where an arm swings (other objects pass there once), and
metres by which the body may reach beyond the farthest of these returns."""
MIN_OVERLAP = 0.8  # least share of a part's cells that must be present in both the first and the last third
MAX_DRIFT = 0.025  # metres: greatest change of a part's range from the first third of the recording to the last
STEADIEST = 25  # percentile of a part's drift that counts: a hinged part is steady at its hinge, traffic is nowhere
MIN_CELLS = 4  # least number of neighbouring rays that meet a part of the body
_LOOKS = 16  # scans that vote on whether a possible body is world, and show what is connected to it
_ASKED = 20_000  # greatest number of points of a scan that others vote on
_WORLD_SHARE = 0.05  # share of hits among the reports above which a cell is world
_LEAST_SHARE = 0.02  # share of free-space observations among the reports; fewer may be due to errors of the poses


def find_ego_body(
    frames: Items[Frame], T_level_scan: Pose, lidar: Lidar, settings: CandidatesSettings, threads: int = 2
) -> EgoBody | None:
    """Return the ego body that `frames` at the poses `T_level_scan` (N, 4, 4) show for one `lidar`.

    None if there is none or too little motion to find it.
    """
    T_level_sensor, max_range = T_level_scan @ lidar.T_scan_sensor, settings.ego_body.max_range
    scans = _scans_apart(T_level_sensor)
    if len(scans) < MIN_SCANS:
        return None

    def extent(frame: Frame) -> Ranges:
        rows, part = frame.of_sensor(lidar.number)
        is_ground = find_ground(frame.points_level, frame.origin_level, settings.ground)[0]  # it connects nothing
        return extent_in(raw_points(part), is_ground[rows], reach, lidar.pattern, max_range)

    with ThreadPoolExecutor(threads) as pool:
        ranges = np.stack(list(pool.map(lambda i: _nearest_ranges(frames[i], lidar, max_range), scans)))
        few = [frames[i] for i in evenly_spread(scans, _LOOKS)]
        reach = _find_reach(ranges, few, lidar, settings)
        return EgoBody(reach, extent_in_most(list(pool.map(extent, few)))) if reach.any() else None


def _find_reach(ranges: Ranges, few: list[Frame], lidar: Lidar, settings: CandidatesSettings) -> Ranges:
    """Return (H, W) the range up to which the body reaches along each ray of `lidar`, metres; 0 where there is none.

    `ranges` (K, H, W) are those of `_nearest_ranges` in K frames, a `few` of which vote.
    """
    pattern, about = lidar.pattern, settings.ego_body
    first, _, last = np.array_split(ranges, 3)
    ends, slack = np.stack([find_constant(part, about) for part in (first, last)], axis=1)
    near = np.stack([_find_near(part, about.near_reach) for part in (first, last)])
    near = np.where((near > 0.0).all(axis=0), near.max(axis=0), np.float32(0.0))
    may_be = np.maximum(ends.max(axis=0), near)
    # Even ground keeps its range, too, and its own hits do not count; people before it would decide that it is body.
    nearest = np.where(ends > 0.0, ends - 2.0 * slack, np.float32(np.inf)).min(axis=0)
    nearest = np.where(near > 0.0, np.float32(0.0), nearest)
    asked = [frame.of_sensor(lidar.number)[1] for frame in few]
    is_body = decide_body(_ask_others(asked, pattern, may_be, nearest, settings.free_space), pattern, may_be)
    ends[:, ~is_body], near[~is_body] = 0.0, 0.0
    stays = _stays_put(ends, near, slack.max(axis=0), pattern, about)
    reach = np.maximum(np.where(stays, ends.max(axis=0), 0.0), near)
    # Rays hit and miss an edge alternately, so one cell to each side belongs to the body, unless it is world.
    return np.where((may_be > 0.0) & ~is_body, 0.0, over_neighbours(reach, np.maximum)).astype(np.float32)


def _scans_apart(T_level_sensor: Array) -> list[int]:
    """Return up to `MAX_SCANS` indices of the poses, evenly spread, each after a displacement or a turn."""
    scans = [0]
    for i in evenly_spread(range(len(T_level_sensor)), 2 * MAX_SCANS):
        motion = se3_log(inverse(T_level_sensor[scans[-1]]) @ T_level_sensor[i])
        if np.linalg.norm(motion[:3]) + ARM * np.linalg.norm(motion[3:]) > MIN_STEP:
            scans.append(i)
    return evenly_spread(scans, MAX_SCANS)


def _nearest_ranges(frame: Frame, lidar: Lidar, max_range: float) -> Ranges:
    """Return (H, W) the nearest range in each cell, metres; infinite beyond `max_range`, NaN without return."""
    nearest = project(raw_points(frame.of_sensor(lidar.number)[1]), lidar.pattern).rays[..., 0]
    ranges = np.where(nearest < max_range / UNIT, np.float32(UNIT) * nearest, np.float32(np.inf))
    return np.where(nearest == NO_RAY, np.float32(np.nan), ranges)


def find_constant(ranges: Ranges, settings: EgoBodySettings) -> Ranges:
    """Return (2, H, W): the range up to which a body reaches where most of `ranges` (K, H, W) agree, and its tolerance.

    A face met at a grazing angle (a trailer's long side) changes its range by much when it swings by little, so
    ranges also agree if they differ by less than half the difference between neighbouring rays.
    """
    n = (~np.isnan(ranges)).sum(axis=0)
    ordered = np.sort(ranges, axis=0)  # NaN last
    middle = np.take_along_axis(ordered, np.stack([np.maximum(n - 1, 0) // 2, np.minimum(n // 2, len(ranges) - 1)]), 0)
    with np.errstate(invalid="ignore"):  # of infinities
        median = np.where(n >= settings.min_share * len(ranges), 0.5 * middle.sum(axis=0), np.float32(np.inf))
        steps = np.abs(np.stack([np.roll(median, shift, axis=1) for shift in (-1, 1)]) - median)
        tolerance = settings.tolerance + 0.5 * np.where(steps < GRAZING * median, steps, np.float32(0.0)).max(axis=0)
        n_same = (np.abs(ranges - median) < tolerance).sum(axis=0)
    is_same = np.isfinite(median) & (n_same >= settings.min_share * n)
    return np.where(is_same, np.stack([median + tolerance, tolerance]), np.float32(0.0))


def _find_near(ranges: Ranges, near_reach: float) -> Ranges:
    """Return (H, W) the range up to which a body reaches where scans repeatedly return from within `near_reach`."""
    is_near = ranges < near_reach
    farthest = np.where(is_near, ranges, np.float32(0.0)).max(axis=0)
    return np.where(is_near.mean(axis=0) >= NEAR_SHARE, farthest + NEAR_MARGIN, np.float32(0.0))


def _stays_put(ends: Ranges, near: Ranges, slack: Ranges, pattern: BeamPattern, settings: EgoBodySettings) -> Mask:
    """Return (H, W) bool: connected parts at the same place in both `ends` (2, H, W), which are 0 where there is none.

    The drift of a ray's range is scaled by its tolerance `slack` (H, W), metres. A part that begins within arm's reach
    (`near`, H, W; 0 elsewhere) stays, however it swings.
    """
    is_part = np.logical_or(*(ends > 0.0))
    v, u = np.nonzero(is_part)
    part, n_parts = parts_of(directions(pattern, v, u) * ends[:, v, u].max(axis=0)[:, None])
    # Allow an offset of one cell to each side.
    in_both = np.all([over_neighbours(end, np.maximum) > 0.0 for end in ends], axis=0)[v, u]
    size = np.bincount(part, minlength=n_parts)
    overlap = np.bincount(part, in_both, n_parts) / np.maximum(size, 1)
    drift = np.where((ends[:, v, u] > 0.0).all(axis=0), np.ptp(ends[:, v, u], axis=0), np.nan)
    drift *= settings.tolerance / np.maximum(slack[v, u], settings.tolerance)
    is_body = (overlap >= MIN_OVERLAP) & (size >= MIN_CELLS)
    for k in np.flatnonzero(is_body):
        of_part = drift[(part == k) & np.isfinite(drift)]
        is_body[k] = len(of_part) > 0 and np.percentile(of_part, STEADIEST) <= MAX_DRIFT
    is_body |= np.bincount(part, near[v, u] > 0.0, n_parts) >= MIN_CELLS
    is_part[v, u] = is_body[part]
    return is_part


def _ask_others(
    frames: list[Frame], pattern: BeamPattern, reach: Ranges, nearest: Ranges, settings: FreeSpaceSettings
) -> Array:
    """Return (3, H, W) the numbers of reports, hits and free-space observations of each cell.

    Each of `frames` reports on the points of all others that are nearer than `reach` and not before `nearest`, both
    (H, W), metres.
    """
    raws = [raw_points(frame) for frame in frames]
    images = [image_of(frame, raw, pattern) for frame, raw in zip(frames, raws, strict=True)]
    tolerances = tolerances_of(settings)
    hit = settings.hit + settings.hit_per_metre * reach  # a ray that met the body may end so much beyond
    may_be_met = over_neighbours(np.where(reach > 0.0, reach + hit, 0.0).astype(np.float32), np.maximum)
    votes = np.zeros((3, reach.size))
    for frame, raw in zip(frames, raws, strict=True):
        cell = cells_within(raw, reach, pattern, nearest)
        rows = np.flatnonzero(cell >= 0)
        rows = rows[:: max(len(rows) // _ASKED, 1)]
        points, of_points = np.take(frame.points, rows, axis=0), np.zeros((3, len(rows)))
        for other, image in zip(frames, images, strict=True):
            if other is frame:
                continue
            T = inverse(other.T_level_sensor) @ frame.T_level_sensor
            codes, _ = look_through(np.ascontiguousarray(points.T), T[:3].astype(np.float32), image, tolerances)
            meets_itself = cells_within(transform(T, points), may_be_met, pattern) >= 0
            of_points += codes >= EDGE, (codes == HIT) & ~meets_itself, codes > HIT
        votes += [np.bincount(cell[rows], of_kind, reach.size) for of_kind in of_points]
    return votes.reshape(3, *reach.shape)


def image_of(frame: Frame, raw: Points, pattern: BeamPattern) -> RangeImage:
    """Return the range image of all points of a frame; each scan has its own times, if its seam drifts."""
    sweep_time, is_last = last_looks(raw, frame.sweep_time)
    projection = project(raw, pattern, is_last)
    return make_image(projection, pattern._replace(sweep_time=sweep_time), motion_of(frame), projection.cell >= 0)


def decide_body(votes: Array, pattern: BeamPattern, reach: Ranges) -> Mask:
    """Return (H, W) bool: cells whose `reach` (H, W; 0 for none) is body, according to their `votes` (3, H, W).

    Cells whose own votes do not decide follow the majority of the cells of their part. The votes of a cell are about
    the same few points (a foot on the road), so each cell counts once, however many they are.
    """
    reported, hits, through = votes
    is_world = (hits > _WORLD_SHARE * reported) & (hits >= through)
    is_through = (through > hits) & (through > _LEAST_SHARE * reported)
    v, u = np.nonzero((reach > 0.0) & ~is_world)
    part, n_parts = parts_of(directions(pattern, v, u) * reach[v, u][:, None])
    n_through, n_hit = (np.bincount(part, of_cells[v, u], n_parts) for of_cells in (is_through, hits > through))
    is_body = np.zeros(reach.shape, np.bool_)
    is_body[v, u] = is_through[v, u] | (n_through > n_hit)[part]
    return is_body
