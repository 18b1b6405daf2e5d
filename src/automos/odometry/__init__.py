"""LiDAR odometry: the pose of every scan, from the scans alone (paper III-A)."""

from automos.odometry.estimate import estimate_trajectory

__all__ = ["estimate_trajectory"]
