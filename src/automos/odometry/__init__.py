"""Poses of every scan from the scans alone (paper III-A)."""

from automos.odometry.estimate import estimate_trajectory
from automos.odometry.frames import make_frame
from automos.odometry.trajectory import Trajectory

__all__ = ["Trajectory", "estimate_trajectory", "make_frame"]
