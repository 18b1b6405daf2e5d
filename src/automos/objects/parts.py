"""Parts: which tracklets are pieces of a moving body.

Two solid bodies are never in one place. So a tracklet that lies within a moving body's box in most of its scans is a
part of it: a wheel, a mirror, the edge of a roof.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.core.scan import Mask
from automos.objects.tracks import Tracks

Rows = npt.NDArray[np.int64]
WITHIN = 0.5  # share of its scans in which a part lies within the body's box
BESIDE = 0.3  # metres around a body's box in which its parts lie


def parts_of_bodies(tracks: Tracks, is_moving: Mask, weight: npt.NDArray) -> Rows:
    """Return (R,) for each row the track that it is a part of: its own, or a heavier moving one whose box it lies in.

    tracks : whole boxes of the moving ones.   weight : (T,) points over life.
    """
    rows, body_rows = _enclosed(tracks, is_moving)
    lighter = weight[tracks.track[rows]] < weight[tracks.track[body_rows]]
    rows, body_rows = rows[lighter], body_rows[lighter]
    part, body = tracks.track[rows], tracks.track[body_rows]
    pairs, begin, times = _grouped(part, body)
    end = begin + times - 1
    way = tracks.center[body_rows[end]] - tracks.center[body_rows[begin]]
    apart = tracks.center[rows[end]] - tracks.center[rows[begin]] - way
    goes_with = np.linalg.norm(apart, axis=1) <= np.maximum(0.5 * np.linalg.norm(way, axis=1), BESIDE)
    share = times / np.bincount(tracks.track[tracks.is_observed], minlength=len(tracks))[pairs[:, 0]]
    share[~goes_with] = 0.0
    owner = np.arange(len(tracks))
    for k in np.argsort(share, kind="stable"):  # the greatest share comes last and remains
        if share[k] >= WITHIN:
            owner[pairs[k, 0]] = pairs[k, 1]
    root = owner.copy()
    while not np.array_equal(root, root[root]):  # ends, as each owner is heavier
        root = root[root]
    out = tracks.track.copy()
    is_theirs = owner[part] == body
    out[rows[is_theirs]] = root[part[is_theirs]]
    return out


def _enclosed(tracks: Tracks, is_moving: Mask) -> tuple[Rows, Rows]:
    """Return the observed rows (P,) in a moving track's box in their scan, and its rows (P,), by pair and scan."""
    found: list[tuple[Rows, Rows]] = [(np.zeros(0, np.int64),) * 2]
    for here in tracks.rows_by_scan(int(tracks.scan.max(initial=-1)) + 1):
        bodies = here[is_moving[tracks.track[here]]]
        k, j = np.nonzero(lies_within(tracks, here, bodies))
        found.append((here[k], bodies[j]))
    rows, bodies = (np.concatenate(column) for column in zip(*found, strict=True))
    is_other = tracks.is_observed[rows] & (tracks.track[rows] != tracks.track[bodies])
    rows, bodies = rows[is_other], bodies[is_other]
    order = np.lexsort((tracks.scan[rows], tracks.track[bodies], tracks.track[rows]))
    return rows[order], bodies[order]


def _grouped(a: Rows, b: Rows) -> tuple[Rows, Rows, Rows]:
    """Return the distinct pairs (K, 2) of sorted `a` and `b` (P,), where each begins, and how often it occurs."""
    begin = np.flatnonzero((np.diff(a, prepend=-1) != 0) | (np.diff(b, prepend=-1) != 0))
    return np.stack([a[begin], b[begin]], axis=1), begin, np.diff(np.append(begin, len(a)))


def lies_within(tracks: Tracks, rows: Rows, bodies: Rows) -> Mask:
    """Return (K, J) whether the centre of each of `rows` (K,) is within the box of each of `bodies` (J,)."""
    offset = tracks.center[rows][:, None] - tracks.center[bodies]
    c, s = np.cos(tracks.yaw[bodies]), np.sin(tracks.yaw[bodies])
    along = np.abs(c * offset[..., 0] + s * offset[..., 1]) - 0.5 * tracks.size[bodies, 0]
    across = np.abs(c * offset[..., 1] - s * offset[..., 0]) - 0.5 * tracks.size[bodies, 1]
    above = np.abs(offset[..., 2]) - 0.5 * tracks.size[bodies, 2]
    return np.maximum(np.maximum(along, across), above) <= BESIDE
