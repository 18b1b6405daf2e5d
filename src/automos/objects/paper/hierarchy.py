"""HDBSCAN at several densities, and the choice among its nested segments.

Paper III-C with III-F: one HDBSCAN fit gives the single-linkage tree of the mutual reachability distance; cutting it at
eps = 2.0, 1.0, 0.5, 0.25 m gives nested segments. The paper does not say how they are combined. Its first author does
(PRBonn/auto-mos, issue 3): a segment's score is its share of dynamic points, and a parent is kept unless its children
score higher, as in Hu, Held and Ramanan, "Learning to Optimally Segment Point Clouds" (RA-L 2020).
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.cluster.hierarchy import fcluster
from scipy.cluster.hierarchy import linkage as single_linkage
from scipy.ndimage import maximum, minimum


def cluster_nested(points: npt.NDArray, epsilons: Sequence[float], min_samples: int) -> npt.NDArray[np.int32]:
    """Return (len(epsilons), N) int32 segment ids, one row per eps, nested for decreasing eps.

    Points nearer than eps in mutual reachability distance (transitively) share a segment. Ids are 0.. within a row.

    points : (N, 3) metres.   epsilons : metres, decreasing.   min_samples : number of neighbours of a dense point.
    """
    n = len(points)
    if n < 2:
        return np.zeros((len(epsilons), n), np.int32)
    if n <= min_samples:  # hdbscan needs more points than neighbours
        linkage = single_linkage(points)
    else:
        linkage = _mutual_reachability_linkage(np.asarray(points, np.float64), min_samples)
    return np.stack([_cut(linkage, epsilon) for epsilon in epsilons])


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


def _cut(linkage: npt.NDArray[np.float64], epsilon: float) -> npt.NDArray[np.int32]:
    """Return (n,) the segments of `linkage` (n - 1, 4; SciPy's) at `epsilon`, in the order of their first point."""
    _, first, segment = np.unique(fcluster(linkage, epsilon, "distance"), return_index=True, return_inverse=True)
    return first.argsort().argsort()[segment].astype(np.int32)


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


def _summarise(
    level: npt.NDArray[np.int32], weight: npt.NDArray, score: npt.NDArray, points: npt.NDArray
) -> tuple[npt.NDArray, npt.NDArray, npt.NDArray]:
    """Return mass, weighted mean score and longest ground extent (S,) of each segment of one level."""
    mass, segments = np.bincount(level, weight), np.arange(level.max() + 1)
    sides = [maximum(axis, level, segments) - minimum(axis, level, segments) for axis in points[:, :2].T]
    return mass, np.bincount(level, weight * score) / mass, np.max(sides, axis=0)
