"""A made-up sweep of a small street, for what needs to run once before real scans come."""

import numpy as np

SPEED = 3.0
"""Metres per second of the sensor, so that its sweeps need compensation."""
HEIGHT = 1.8
"""Metres above the ground, where it is."""
BOX = 0.9
"""Metres, half the side of the box that overtakes it."""


def box_center(time: float | np.ndarray) -> np.ndarray:
    """Return the (..., 3) middle of the box at some time in seconds."""
    return 9.0 * np.asarray(time)[..., None] * np.array([1.0, 0.0, 0.0]) + np.array([-7.0, 5.0, BOX])


def made_up_sweep(stamp: float) -> np.ndarray:
    """Return (N, 3) points: in a walled square, a box overtakes the sensor."""
    turn, elevation = np.meshgrid(np.arange(0.1, 360.0, 1.4) / 360.0, np.linspace(-0.38, 0.07, 32), indexing="ij")
    azimuth, time = 2.0 * np.pi * turn.ravel() - np.pi, stamp + 0.1 * turn.ravel() - 0.05
    rays = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation.ravel())])
    sensor = SPEED * time[:, None] * np.array([1.0, 0.0, 0.0]) + np.array([0.0, 0.0, HEIGHT])
    distance = ((np.where(rays > 0, [30.0, 12.0, np.inf], [-20.0, -12.0, 0.0]) - sensor) / rays).min(axis=1)
    center = box_center(time)
    faces = np.sort([(center - BOX - sensor) / rays, (center + BOX - sensor) / rays], axis=0)
    enters, leaves = faces[0].max(axis=1), faces[1].min(axis=1)
    return np.where((enters > 0) & (enters < leaves), enters, distance)[:, None] * rays
