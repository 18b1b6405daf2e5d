"""Recordings written again without the points that move, for mapping and odometry."""
