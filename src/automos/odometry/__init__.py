"""LiDAR odometry: the pose of every scan, from the scans alone (paper III-A)."""

from automos.odometry.estimate import estimate_trajectory
from automos.odometry.trajectory import Trajectory, make_frame

__all__ = ["Trajectory", "estimate_trajectory", "make_frame"]
