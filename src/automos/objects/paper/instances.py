"""The instances of one scan: non-ground points, clustered, scored and boxed (paper III-C)."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.upright_boxes import Boxes
from automos.objects.boxes import fit_boxes
from automos.objects.paper.hierarchy import choose_segments, cluster_nested
from automos.objects.paper.voxels import group_by_voxel
from automos.settings import HdbscanSettings

_VOXEL = 0.1
"""Metres: voxels are clustered, not points, as HDBSCAN's time grows with their number; a near wall has hundreds."""


@dataclass(frozen=True, eq=False)
class Instances:
    """Instances of one frame: ids (M,) int32, -1 for none, and the box of each (level frame)."""

    ids: npt.NDArray[np.int32]
    boxes: Boxes


def find_instances(
    points: npt.NDArray, is_candidate: npt.NDArray, is_eligible: npt.NDArray[np.bool_], settings: HdbscanSettings
) -> Instances:
    """Return the instances of one frame.

    Parameters
    ----------
    points : (M, 3) float, metres, level frame.
    is_candidate : (M,) float in [0, 1], dynamic score of each point.
    is_eligible : (M,) bool, points that may belong to an instance: neither ground nor ego body nor out of range.
    """
    eligible = np.flatnonzero(is_eligible)
    group, mean = group_by_voxel(points[eligible], _VOXEL)
    weight = np.bincount(group, minlength=len(mean)).astype(np.float64)
    score = np.bincount(group, is_candidate[eligible], len(mean)) / weight
    # A dense point has as many neighbours as the smallest segment has points (N_min, III-F).
    nested = cluster_nested(mean, settings.epsilons, settings.min_points)
    chosen, segment_score = choose_segments(nested, weight, score, settings.min_points, settings.max_side, mean)
    is_instance = segment_score >= settings.min_score
    number = np.full(len(segment_score) + 1, -1, np.int32)  # the last entry is for segment -1
    number[:-1][is_instance] = np.arange(is_instance.sum())
    members = np.full(len(points), -1, np.int32)
    members[eligible] = number[chosen][group]
    return Instances(members, fit_boxes(mean, number[chosen], segment_score[is_instance]))
