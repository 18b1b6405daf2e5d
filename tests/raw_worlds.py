"""Raw sweeps of tiny worlds: every beam leaves from where the sensor is at the beam's own time."""

from collections.abc import Callable, Sequence

import numpy as np
from worlds import SCAN_GAP, SENSOR_HEIGHT, Block, cast, van

from automos.core.geometry import make_transform
from automos.core.scan import Scan

N_COLUMNS = 360
N_SECTORS = 60
REACH = 70.0  # m

TOWN = (
    Block((-14.0, 12.0, 4.0), (9.0, 4.0, 8.0), 0.1),
    Block((-2.0, 13.0, 4.0), (7.0, 4.0, 8.0), -0.1),
    Block((9.0, 11.5, 4.0), (8.0, 4.0, 8.0)),
    Block((21.0, 13.0, 4.0), (9.0, 4.0, 8.0), 0.2),
    Block((-12.0, -11.0, 4.0), (10.0, 4.0, 8.0)),
    Block((3.0, -12.0, 4.0), (9.0, 4.0, 8.0), 0.15),
    Block((16.0, -11.0, 4.0), (8.0, 4.0, 8.0), -0.1),
    Block((40.0, 0.0, 4.0), (4.0, 40.0, 8.0)),
    Block((-30.0, 0.0, 4.0), (4.0, 40.0, 8.0)),
    van(-4.0, 6.0),
    van(7.0, -6.0, 0.1),
    van(16.0, 6.5),
    Block((2.0, 6.5, 2.0), (0.4, 0.4, 4.0)),
    Block((12.0, -6.5, 2.0), (0.4, 0.4, 4.0)),
)
"""Houses at all angles, parked vans, posts: a place that holds a sensor in every direction."""

CANYON = (
    Block((20.0, 9.0, 6.0), (160.0, 2.0, 12.0)),
    Block((20.0, -9.0, 6.0), (160.0, 2.0, 12.0)),
    *(Block((x, 7.6, 3.0), (1.0, 1.0, 6.0)) for x in (-21.0, -9.0, 2.0, 19.0, 30.0, 45.0)),
    *(Block((x, -7.6, 3.0), (1.0, 1.0, 6.0)) for x in (-15.0, -4.0, 9.0, 25.0, 38.0)),
)
"""Two smooth façades with a porch here and there."""


def curve(speed: float, turn: float) -> Callable[[float], np.ndarray]:
    """Return T_ground_sensor (4, 4) as a function of seconds: `speed` m/s, turning by `turn` rad/s."""

    def pose(t: float) -> np.ndarray:
        angle = turn * t
        c, s = np.cos(angle), np.sin(angle)
        x, y = (speed * t, 0.0) if turn == 0.0 else (speed * s / turn, speed * (1.0 - c) / turn)
        return make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [x, y, SENSOR_HEIGHT])

    return pose


def sweep(
    blocks: Sequence[Block],
    pose: Callable[[float], np.ndarray],
    middle: float,
    turn: int = -1,
    seam_deg: float = 180.0,
    n_beams: int = 24,
    seed: int = 0,
) -> Scan:
    """Return the raw sweep of a spinning sensor around the time `middle` (s), with the time of each point.

    `turn` is +1 for counter-clockwise; the sweep takes SCAN_GAP and starts and ends at azimuth `seam_deg`.
    """
    rng = np.random.default_rng([seed, round(1000 * middle)])
    elevation = np.radians(np.linspace(-20.0, 6.0, n_beams))
    columns = np.arange(N_COLUMNS).reshape(N_SECTORS, -1)
    points, times = [], []
    for sector in columns:
        fraction = np.repeat((sector + 0.5) / N_COLUMNS, n_beams)
        azimuth = np.radians(seam_deg) + turn * 2.0 * np.pi * fraction
        e = np.tile(elevation, len(sector))
        rays = np.stack([np.cos(e) * np.cos(azimuth), np.cos(e) * np.sin(azimuth), np.sin(e)], axis=1)
        now = middle + SCAN_GAP * (fraction.mean() - 0.5)
        T = pose(now)
        distance, _ = cast(blocks, T[:3, 3], rays @ T[:3, :3].T, now)
        seen = distance < REACH
        measured = distance[seen] + rng.normal(0.0, 0.01, seen.sum())
        points.append(measured[:, None] * rays[seen])
        times.append(SCAN_GAP * fraction[seen])
    return Scan(np.concatenate(points).astype(np.float32), time=np.concatenate(times).astype(np.float32), stamp=middle)


def rosette(blocks: Sequence[Block], pose: Callable[[float], np.ndarray], middle: float, n_points: int = 9000) -> Scan:
    """Return the raw sweep around the time `middle` (s) of a sensor that looks ahead and never repeats its pattern.

    Two prisms turn the ray, as in Livox's sensors; points are in the order of measurement, with the time of each.
    """
    fraction = (np.arange(n_points) + 0.5) / n_points
    now = middle + SCAN_GAP * (fraction - 0.5)
    a, b = (2.0 * np.pi * rate * now for rate in (121.6, -77.7))
    azimuth, elevation = 0.6 * (np.cos(a) + np.cos(b)), 0.3 * (np.sin(a) + np.sin(b))
    rays = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], 1)
    distance = np.empty(n_points)
    for part in np.array_split(np.arange(n_points), N_SECTORS):
        T = pose(now[part].mean())
        distance[part] = cast(blocks, T[:3, 3], rays[part] @ T[:3, :3].T, middle)[0]
    seen = distance < REACH
    noisy = distance[seen] + np.random.default_rng(round(1000 * middle)).normal(0.0, 0.01, seen.sum())
    points, times = noisy[:, None] * rays[seen], SCAN_GAP * fraction[seen]
    return Scan(points.astype(np.float32), time=times.astype(np.float32), stamp=middle)


def cut_anew(sweeps: Sequence[Scan], turns: float) -> list[Scan]:
    """Return the stream of `sweeps`, each of one turn, as a driver gives it that cuts every `turns` turns."""
    points = np.concatenate([scan.points for scan in sweeps])
    turned = np.concatenate([i + scan.time / SCAN_GAP for i, scan in enumerate(sweeps)])
    scan_of = np.floor(turned / turns).astype(int)
    scans = []
    for k in range(int(len(sweeps) / turns)):
        inside = scan_of == k
        time = (SCAN_GAP * (turned[inside] - k * turns)).astype(np.float32)
        scans.append(Scan(points[inside], time=time, stamp=SCAN_GAP * turns * (k + 0.5)))
    return scans


def untimed(scan: Scan) -> Scan:
    """Return the scan as a format without times gives it."""
    return Scan(scan.points, stamp=scan.stamp, name=scan.name)


def true_poses(pose: Callable[[float], np.ndarray], n: int) -> np.ndarray:
    """Return (n, 4, 4) T_world_sensor at mid-sweep; world is the first scan's sensor frame."""
    poses = np.array([pose(SCAN_GAP * i) for i in range(n)])
    return np.linalg.inv(poses[0]) @ poses


def worst_distance(estimate: np.ndarray, truth: np.ndarray) -> float:
    """Return the greatest distance in metres between positions (N, 4, 4)."""
    return float(np.linalg.norm(estimate[:, :3, 3] - truth[:, :3, 3], axis=1).max())
