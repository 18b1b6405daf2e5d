"""HDBSCAN at several densities, and the choice among its nested segments.

Paper III-C with III-F: one HDBSCAN fit gives the single-linkage tree of the mutual reachability distance; cutting it at
eps = 2.0, 1.0, 0.5, 0.25 m gives nested segments. The paper does not say how they are combined. Its first author does
(PRBonn/auto-mos, issue 3): a segment's score is its share of dynamic points, and a parent is kept unless its children
score higher, as in Hu, Held and Ramanan, "Learning to Optimally Segment Point Clouds" (RA-L 2020).
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.cluster.hierarchy import linkage as single_linkage

from automos.core.kernels import kernel


def cluster_nested(points: npt.NDArray, epsilons: Sequence[float], min_samples: int) -> npt.NDArray[np.int32]:
    """Return (len(epsilons), N) int32 segment ids, one row per eps, nested for decreasing eps.

    Points nearer than eps in mutual reachability distance (transitively) share a segment. Ids are 0.. within a row.

    points : (N, 3) metres.   epsilons : metres, decreasing.   min_samples : number of neighbours of a dense point.
    """
    n = len(points)
    if n < 2:
        linkage = np.zeros((0, 4))
    elif n <= min_samples:  # hdbscan needs more points than neighbours
        linkage = single_linkage(points)
    else:
        linkage = _mutual_reachability_linkage(np.asarray(points, np.float64), min_samples)
    return _cut(n, linkage, np.asarray(epsilons, np.float64))


def _mutual_reachability_linkage(points: npt.NDArray[np.float64], min_samples: int) -> npt.NDArray[np.float64]:
    """Return (n - 1, 4) the single linkage of the mutual reachability distance, in SciPy's format.

    Only the tree of the fit is used. HDBSCAN's own choice of clusters, a fifth of its time, is avoided.
    """
    from hdbscan import HDBSCAN  # takes a second to import

    fit = HDBSCAN(
        min_cluster_size=len(points),
        min_samples=min_samples,
        algorithm="boruvka_kdtree",
        approx_min_span_tree=False,
        core_dist_n_jobs=1,
    ).fit(points)
    return fit.single_linkage_tree_.to_numpy()


@kernel
def _cut(n, linkage, epsilons):  # type: ignore[no-untyped-def]
    """Cut `linkage` (n - 1, 4; SciPy's format: row i merges two nodes into node n + i) at `epsilons`, decreasing."""
    labels = np.empty((len(epsilons), n), np.int32)
    root = np.empty(2 * n, np.int64)
    for level in range(len(epsilons)):
        # From the last merge to the first, so that a node's root is known before it is needed by its children.
        for i in range(len(linkage) - 1, -1, -1):
            node = n + i
            if i == len(linkage) - 1 or linkage[i, 2] > epsilons[level] or root[node] == -1:
                root[node] = node
            below = root[node] if linkage[i, 2] <= epsilons[level] else -1
            root[int(linkage[i, 0])] = below
            root[int(linkage[i, 1])] = below
        id_of = np.full(2 * n, -1, np.int32)
        next_id = 0
        for i in range(n):
            r = root[i] if len(linkage) and root[i] >= 0 else i
            if id_of[r] == -1:
                id_of[r] = next_id
                next_id += 1
            labels[level, i] = id_of[r]
    return labels


def choose_segments(
    nested: npt.NDArray[np.int32],
    weight: npt.NDArray,
    score: npt.NDArray,
    min_points: int,
    max_extent: float,
    points: npt.NDArray,
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float64]]:
    """Return the chosen segments of the eps tree: a parent is kept unless its children score strictly higher.

    A segment's score is the weighted mean of its members' scores; the score of its children is the weighted mean over
    those with at least `min_points`. Segments longer than `max_extent` can only be split; small ones are dropped.

    Parameters
    ----------
    nested : (E, N) int32, from `cluster_nested`, coarse to fine.
    weight : (N,) float, number of the scan's points that each row represents.
    score : (N,) float in [0, 1], share of dynamic points among them.
    points : (N, 3) float, metres, for the extent (longer side of the ground rectangle along the axes, metres).

    Returns
    -------
    ids : (N,) int32 segment of each row, -1 for none.   scores : (S,) score of each segment.
    """
    n_levels, n = nested.shape
    if n == 0:
        return np.full(0, -1, np.int32), np.zeros(0)
    summaries = [_summarise(level, weight, score, points) for level in nested]

    # From fine to coarse: the best score in a segment's subtree, -1 if nothing in it is usable.
    best = [np.where((mass >= min_points) & (extent <= max_extent), value, -1.0) for mass, value, extent in summaries]
    keep = [b >= 0.0 for b in best]
    for level in range(n_levels - 2, -1, -1):
        mass = np.where(best[level + 1] >= 0.0, summaries[level + 1][0], 0.0)
        parent = np.zeros(len(mass), np.int64)
        parent[nested[level + 1]] = nested[level]
        total = np.bincount(parent, mass, len(best[level]))
        reached = np.bincount(parent, mass * best[level + 1], len(best[level]))
        children = np.divide(reached, total, out=np.full(len(total), -1.0), where=total > 0)
        is_split = children > best[level] + 1e-9
        keep[level] &= ~is_split
        best[level] = np.where(is_split, children, best[level])

    ids, is_open = np.full(n, -1, np.int32), np.ones(n, bool)
    scores: list[npt.NDArray[np.float64]] = []
    for level in range(n_levels):
        taken = is_open & keep[level][nested[level]]
        present, rank = np.unique(nested[level][taken], return_inverse=True)
        ids[taken] = sum(len(part) for part in scores) + rank
        scores.append(summaries[level][1][present])
        is_open &= ~taken
    return ids, np.concatenate(scores)


@kernel
def _summarise(level, weight, score, points):  # type: ignore[no-untyped-def]
    """Return mass, weighted mean score and longest ground extent (S,) of each segment of one level."""
    count = level.max() + 1
    mass, value = np.zeros(count), np.zeros(count)
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    for i in range(len(level)):
        s = level[i]
        mass[s] += weight[i]
        value[s] += weight[i] * score[i]
        for a in range(2):
            low[s, a] = min(low[s, a], points[i, a])
            high[s, a] = max(high[s, a], points[i, a])
    extent = np.maximum(high[:, 0] - low[:, 0], high[:, 1] - low[:, 1])
    return mass, value / mass, extent
