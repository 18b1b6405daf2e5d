"""Sweeps of a spinning LiDAR in a yard with posts, ray by ray: what files without names are told apart by."""

import numpy as np

POSTS = np.array([[6.0, 4.0, 0.6], [-9.0, 7.0, 1.5], [14.0, -6.0, 1.0], [-5.0, -11.0, 0.8], [30.0, 9.0, 2.0]])
"""x, y and radius, metres."""
HEIGHT = 1.8


def pose(degrees=0.0, x=0.0, y=0.0, z=0.0):
    """Return (4, 4): a turn to the left, and a place; at z = 0 the ground is 1.8 m below the sensor."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])


def sweep(T=None, seed=0, n_beams=16, n_columns=720):
    """Return x, y, z (sensor frame), intensity, ring and time of the returns of one sweep, in the order of time."""
    T, rng = pose() if T is None else T, np.random.default_rng(seed)
    ring = np.tile(np.arange(n_beams), n_columns)
    phase = np.repeat(np.arange(n_columns) / n_columns, n_beams)
    azimuth, elevation = np.pi - 2.0 * np.pi * phase, np.radians(-15.0 + 30.0 / (n_beams - 1) * ring)
    rays = np.column_stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )
    origin, D = T[:3, 3], rays @ T[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        hits = [(-HEIGHT - origin[2]) / D[:, 2], *((side - origin[1]) / D[:, 1] for side in (-18.0, 18.0))]
        hits += [(end - origin[0]) / D[:, 0] for end in (-60.0, 60.0)]
        for x, y, radius in POSTS:
            a, b = (D[:, :2] ** 2).sum(1), D[:, :2] @ (origin[:2] - [x, y])
            root = b**2 - a * (((origin[:2] - [x, y]) ** 2).sum() - radius**2)
            hits.append((-b - np.sqrt(root)) / a)
    hits = np.array([np.where(hit > 0.3, hit, np.inf) for hit in hits])
    ranges, what = hits.min(axis=0), hits.argmin(axis=0)
    xyz = rays * (ranges + rng.normal(0.0, 0.01, len(ranges)))[:, None]
    seen = ranges < 80.0
    shine = np.clip(0.15 + 0.08 * what + rng.normal(0.0, 0.05, len(what)), 0.0, 1.0)
    columns = {"x": xyz[:, 0], "y": xyz[:, 1], "z": xyz[:, 2], "intensity": shine, "ring": ring, "time": 0.1 * phase}
    return {name: column[seen].astype(np.float32) for name, column in columns.items()}


def points_of(columns):
    """Return the (N, 3) coordinates."""
    return np.column_stack([columns[axis] for axis in "xyz"])


def moved(columns, T):
    """Return the columns with coordinates taken into another frame, as float64."""
    xyz = points_of(columns).astype(np.float64) @ T[:3, :3].T + T[:3, 3]
    return {**columns, "x": xyz[:, 0], "y": xyz[:, 1], "z": xyz[:, 2]}
