"""Range images of a LiDAR that turns on a moving vehicle, made into points (Waymo's, with a pose for every pixel)."""

import numpy as np
import numpy.typing as npt

from automos.core.cells import moved
from automos.core.kernels import kernel
from automos.core.scan import Array, Points, Pose


def place_pixels(
    distance: npt.NDArray[np.float32],
    pixel_pose: npt.NDArray[np.float32],
    elevation: Array,
    T_vehicle_laser: Pose,
    T_target_world: Pose,
) -> Points:
    """Return the (H * W, 3) float32 points of a range image, row by row, in the target frame.

    Parameters
    ----------
    distance : (H, W) metres; not above 0 without a return, whose point is at the origin.
    pixel_pose : (H, W, 6) roll, pitch, yaw (radians, about fixed axes) and x, y, z of the vehicle in the world, when
        each pixel was measured.
    elevation : (H,) radians of each row.
    T_vehicle_laser : (4, 4). Columns go clockwise around the vehicle, from behind it to behind it, whichever way the
        laser's own x-axis points.
    T_target_world : (4, 4).
    """
    height, width = distance.shape
    azimuth = np.pi * (1.0 - 2.0 * (np.arange(width) + 0.5) / width)
    azimuth -= np.arctan2(T_vehicle_laser[1, 0], T_vehicle_laser[0, 0])
    points = np.zeros((height * width, 3), np.float32)
    _place(distance, pixel_pose, elevation, azimuth, T_vehicle_laser, T_target_world, points)
    return points


@kernel
def _place(distance, pixel_pose, elevation, azimuth, T_vehicle_laser, T_target_world, points):  # type: ignore[no-untyped-def]
    """Fill `points` (H * W, 3) from ranges (H, W) and poses (H, W, 6: roll, pitch, yaw, x, y, z) of the vehicle."""
    height, width = distance.shape
    for i in range(height):
        for j in range(width):
            r = distance[i, j]
            if r <= 0.0:
                continue
            level, up = r * np.cos(elevation[i]), r * np.sin(elevation[i])
            x, y, z = moved(T_vehicle_laser, level * np.cos(azimuth[j]), level * np.sin(azimuth[j]), up)
            roll, pitch, yaw = pixel_pose[i, j, 0], pixel_pose[i, j, 1], pixel_pose[i, j, 2]
            y, z = np.cos(roll) * y - np.sin(roll) * z, np.sin(roll) * y + np.cos(roll) * z
            x, z = np.cos(pitch) * x + np.sin(pitch) * z, np.cos(pitch) * z - np.sin(pitch) * x
            x, y = np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x + np.cos(yaw) * y
            x, y, z = x + pixel_pose[i, j, 3], y + pixel_pose[i, j, 4], z + pixel_pose[i, j, 5]
            points[i * width + j] = moved(T_target_world, x, y, z)
