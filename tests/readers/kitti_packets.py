"""What KITTI's vehicle writes beside its scans: GPS/IMU packets and calibrations, made from known poses."""

import numpy as np
from scipy.spatial.transform import Rotation

from automos.core.geometry import inverse, make_transform

EARTH = 6378137.0
T_SENSOR_IMU = inverse(make_transform(Rotation.from_euler("z", 0.01).as_matrix(), [0.81, -0.32, 0.8]))
T_CAMERA_SENSOR = make_transform([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.0, -0.08, -0.27])
R_RECTIFIED = Rotation.from_euler("xyz", [0.01, -0.005, 0.008]).as_matrix()
PROJECTION = np.array([[721.5, 0, 609.6, 44.9], [0, 721.5, 172.9, 0.2], [0, 0, 1, 0.003]])


def packets(T_ground_sensor, latitude=49.0, longitude=8.4):
    """Return the 30 numbers of each pose's packet."""
    T_map_imu = T_ground_sensor @ T_SENSOR_IMU
    scale = np.cos(np.radians(latitude)) * EARTH
    x = T_map_imu[:, 0, 3] - T_map_imu[0, 0, 3] + scale * np.radians(longitude)
    y = T_map_imu[:, 1, 3] - T_map_imu[0, 1, 3] + scale * np.log(np.tan(np.radians(90 + latitude) / 2))
    rows = np.zeros((len(x), 30))
    rows[:, 0] = 2 * np.degrees(np.arctan(np.exp(y / scale))) - 90
    rows[:, 1] = np.degrees(x / scale)
    rows[:, 2] = 112.0 + T_map_imu[:, 2, 3]
    rows[:, 3:6] = Rotation.from_matrix(T_map_imu[:, :3, :3]).as_euler("xyz")
    return rows


def line(values):
    return " ".join(f"{value:.15g}" for value in np.ravel(values))


def sees(points):
    """Return whether the camera sees each point: in front of it and within 1242 x 375 pixels."""
    ahead = (points @ T_CAMERA_SENSOR[:3, :3].T + T_CAMERA_SENSOR[:3, 3]) @ R_RECTIFIED.T
    u, v, w = (ahead @ PROJECTION[:, :3].T + PROJECTION[:, 3]).T
    return (ahead[:, 2] > 0) & (u / w >= 0) & (u / w < 1242) & (v / w >= 0) & (v / w < 375)
