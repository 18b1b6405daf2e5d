"""LiDAR odometry: the pose of every scan, from the scans alone (paper III-A)."""
