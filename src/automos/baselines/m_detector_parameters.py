"""M-detector's parameters, as its authors publish them for KITTI (config/kitti/kitti0.yaml of the public repository).

Their names are ours: their file counts its cases ("thr1", "thr2", "thr3") and says in comments what each is.
"""

from __future__ import annotations

from dataclasses import dataclass

from automos.baselines.depth_images import Window
from automos.baselines.occlusion_tests import AlongRay, Crossing


@dataclass(frozen=True)
class Parameters:
    """Depth images, the three tests, clusters. A sensor whose rays lie further apart gets windows as much wider.

    Attributes
    ----------
    images : int
        Past depth images asked.
    gap : float
        Seconds between them.
    row, column : float
        Rad, pixel of a depth image in elevation and azimuth.
    min_range : float
        Metres, nearer points are not events: the vehicle itself.
    edge : float
        Share of a scan's points at the top and at the bottom of the view that are not events: past images see but one
        side of them. The authors give elevations (for KITTI -23 to 2 degrees), this is what these leave out.
    crossing, away, nearer : Crossing and AlongRay
        The tests; windows are for pixels of `row` x `column`.
    cluster_voxel : float
        Metres.
    cluster_reach : int
        Voxels, over which events are of one cluster.
    cluster_voxels : int
        Voxels that make a cluster.
    cluster_share : float
        Of the objects' points in its box that are events.
    """

    images: int
    gap: float
    row: float
    column: float
    min_range: float
    edge: float
    crossing: Crossing
    away: AlongRay
    nearer: AlongRay
    cluster_voxel: float
    cluster_reach: int
    cluster_voxels: int
    cluster_share: float


KITTI = Parameters(
    images=15,
    gap=0.1,
    row=0.007,
    column=0.005,
    min_range=2.0,
    edge=0.03,
    crossing=Crossing(
        depth=0.15,
        images=2,
        stands=Window(0.01, 0.015, 0.15),
        tolerance=0.15,
        surface=0.5,
        surface_from=10.0,
        surface_slope=0.1,
        surface_window=Window(0.015, 0.007),
        surface_reach=10.0,
    ),
    away=AlongRay(
        sign=1.0,
        same=Window(0.01, 0.015),
        depth=0.0,
        share=0.005,
        reach=10.15,
        min_speed=1.0,
        max_acceleration=7.0,
        stands=Window(0.01, 0.01),
        tolerance=0.2,
        even=Window(0.01, 0.01),
        even_depth=0.1,
        even_reach=0.5,
    ),
    nearer=AlongRay(
        sign=-1.0,
        same=Window(0.01, 0.01),
        depth=0.15,
        share=0.0,
        reach=100.0,
        min_speed=0.5,
        max_acceleration=15.0,
        stands=Window(0.01, 0.008),
        tolerance=0.2,
        even=Window(0.01, 0.01),
        even_depth=0.3,
        even_reach=1.0,
    ),
    cluster_voxel=0.3,
    cluster_reach=2,
    cluster_voxels=8,
    cluster_share=0.3,
)
