"""M-detector's parameters, as its authors publish them for each data set, each with its name and line there.

Files of github.com/hku-mars/M-detector: config/kitti/kitti0.yaml at 0645dab (HDL-64E) and
config/nuscenes/nuscenes0.yaml at e125a9d (HDL-32E). No other number is in the method but what follows from the sensor,
as the README asks (lines 98 to 104): depth images as far apart as scans, pixels no finer than rays, the view that the
sensor has. For KITTI's sensor the file gives a view from -23 to 2 degrees (lines 22, 23), two degrees less than the
sensor's own.
"""

import math
from dataclasses import dataclass, replace

from automos.baselines.depth_images import Window
from automos.baselines.occlusion_tests import AlongRay, Crossing


@dataclass(frozen=True)
class Parameters:
    """Depth images, the three tests, clusters.

    Attributes
    ----------
    images : int
        Past depth images asked.
    gap : float
        Seconds between them, of faster sensors.
    row, column : float
        Rad, pixel of a depth image in elevation and azimuth.
    blind : float
        Metres, nearer points are not events.
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
    blind: float
    crossing: Crossing
    away: AlongRay
    nearer: AlongRay
    cluster_voxel: float
    cluster_reach: int
    cluster_voxels: int
    cluster_share: float


KITTI = Parameters(
    images=15,  # max_depth_map_num, 14
    gap=0.1,  # depth_map_dur, 13
    row=0.007,  # ver_resolution_max, 104
    column=0.005,  # hor_resolution_max, 105
    blind=0.3,  # blind_dis, 21
    crossing=Crossing(
        depth=0.15,  # depth_thr1, 29
        images=2,  # occluded_map_thr1, 44
        stands=Window(0.01, 0.015, 0.15),  # map_cons_hor_thr1, _ver_thr1, _hor_dis1, 33 to 36
        tolerance=0.15,  # map_cons_depth_thr1, 32
        surface=0.5,  # interp_thr1, 80
        surface_from=10.0,  # interp_start_depth1, 82
        surface_slope=0.1,  # interp_kp1, 83
        surface_window=Window(0.015, 0.007),  # interp_hor_thr, interp_ver_thr, 78, 79
        surface_reach=10.0,  # interp_static_max, 81
    ),
    away=AlongRay(
        sign=1.0,
        same=Window(0.01, 0.015),  # occ_hor_thr2, occ_ver_thr2, 53, 54
        depth=0.0,
        share=0.005,  # k_depth2, 60
        reach=10.15,  # occ_depth_thr2, 52
        min_speed=1.0,  # v_min_thr2, 47
        max_acceleration=7.0,  # acc_thr2, 48
        stands=Window(0.01, 0.01),  # map_cons_hor_thr2, _ver_thr2, 50, 51
        tolerance=0.2,  # map_cons_depth_thr2, 49
        even=Window(0.01, 0.01),  # depth_cons_hor_thr2, _ver_thr2, 57, 58
        even_depth=0.1,  # depth_cons_depth_thr2, 55
        even_reach=0.5,  # depth_cons_depth_max_thr2, 56
    ),
    nearer=AlongRay(
        sign=-1.0,
        same=Window(0.01, 0.01),  # occ_hor_thr3, occ_ver_thr3, 69, 70
        depth=0.15,  # occ_depth_thr3, 68
        share=0.0,
        reach=math.inf,
        min_speed=0.5,  # v_min_thr3, 63
        max_acceleration=15.0,  # acc_thr3, 64
        stands=Window(0.01, 0.008),  # map_cons_hor_thr3, _ver_thr3, 66, 67
        tolerance=0.2,  # map_cons_depth_thr3, 65
        even=Window(0.01, 0.01),  # depth_cons_hor_thr3, _ver_thr3, 73, 74
        even_depth=0.3,  # depth_cons_depth_thr3, 71
        even_reach=1.0,  # depth_cons_depth_max_thr3, 72
    ),
    cluster_voxel=0.3,  # cluster_Voxel_revolusion, 99
    cluster_reach=2,  # cluster_extend_pixel, 96
    cluster_voxels=8,  # cluster_min_pixel_number, 97
    cluster_share=0.3,  # cluster_thrustable_thresold, 98
)

NUSCENES = replace(
    KITTI,  # what is equal in both files; clusters' voxel and share are in that one alone
    images=10,  # max_depth_map_num, 12
    gap=0.2,  # depth_map_dur, 11
    row=0.022,  # ver_resolution_max, 103
    column=0.007,  # hor_resolution_max, 104
    blind=0.2,  # blind_dis, 19
    crossing=KITTI.crossing._replace(
        stands=Window(0.01, 0.03, 0.15),  # map_cons_hor_thr1, _ver_thr1, _hor_dis1, 30 to 32
        tolerance=0.3,  # map_cons_depth_thr1, 29
        surface=1.5,  # interp_thr1, 78
        surface_from=15.0,  # interp_start_depth1, 80
        surface_slope=0.15,  # interp_kp1, 81
        surface_window=Window(0.015, 0.06),  # interp_hor_thr, interp_ver_thr, 76, 77
    ),
    away=KITTI.away._replace(
        same=Window(0.01, 0.04),  # occ_hor_thr2, occ_ver_thr2, 50, 51
        stands=Window(0.01, 0.03),  # map_cons_hor_thr2, _ver_thr2, 47, 48
        even=Window(0.01, 0.03),  # depth_cons_hor_thr2, _ver_thr2, 54, 55
    ),
    nearer=KITTI.nearer._replace(
        same=Window(0.01, 0.04),  # occ_hor_thr3, occ_ver_thr3, 66, 67
        share=0.005,  # k_depth3, 73
        stands=Window(0.01, 0.03),  # map_cons_hor_thr3, _ver_thr3, 63, 64
        even=Window(0.01, 0.03),  # depth_cons_hor_thr3, _ver_thr3, 70, 71
    ),
    cluster_reach=3,  # cluster_extend_pixel, 93
    cluster_voxels=3,  # cluster_min_pixel_number, 94
)

FILES = (KITTI, NUSCENES)
