"""M-detector's step from events to objects ("frame-out"): few or scattered events are dropped, dense ones completed."""

import numpy as np
import numpy.typing as npt

from automos.baselines.m_detector_parameters import Parameters
from automos.baselines.regions import label_regions
from automos.core.scan import Mask


def complete_clusters(points: npt.NDArray, is_event: Mask, is_object: Mask, parameters: Parameters) -> Mask:
    """Return (M,) bool: clusters of events, enough of the objects in their box, and what touches them there.

    points : (M, 3) metres, z up.   is_object : (M,) what is not ground; events on the ground are dropped.
    """
    out = np.zeros(len(points), bool)
    events, objects = np.flatnonzero(is_event & is_object), np.flatnonzero(is_object)
    if not len(events):
        return out
    cluster_of, voxel_of = label_regions(points[events], parameters.cluster_voxel, parameters.cluster_reach)
    for members in np.split(np.argsort(cluster_of, kind="stable"), np.cumsum(np.bincount(cluster_of))[:-1]):
        if len(np.unique(voxel_of[members])) < parameters.cluster_voxels:
            continue
        low, high = points[events[members]].min(axis=0), points[events[members]].max(axis=0)
        inside = objects[((points[objects] >= low) & (points[objects] <= high)).all(axis=1)]
        if is_event[inside].mean() >= parameters.cluster_share:
            region_of, _ = label_regions(points[inside], parameters.cluster_voxel, 1)
            out[inside[np.isin(region_of, region_of[is_event[inside]])]] = True
    return out
