"""Tiny worlds with exact truth for fast tests: upright blocks on a plane, ray-cast by one slab test for all rays.

Scans are instantaneous (nothing to compensate), with a centimetre of range noise so that no coordinate lies exactly on
a voxel's border. `street` has what a street has, `lane` is small.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from automos.core.array_sequence import ArraySequence
from automos.core.geometry import inverse, make_transform
from automos.core.labels import Label
from automos.core.scan import Scan

SCAN_GAP = 0.1  # s
SENSOR_HEIGHT = 1.8  # m


@dataclass(frozen=True)
class Block:
    """An upright box at constant velocity: centre (m) at time 0; length, width, height (m); yaw (rad); m/s."""

    center: tuple[float, float, float]
    size: tuple[float, float, float]
    yaw: float = 0.0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class World:
    """A recording of a tiny world: the scans, their true poses (N, 4, 4) T_world_sensor, the truth of every point."""

    sequence: ArraySequence
    poses: np.ndarray
    truth: list[np.ndarray]


def van(x: float, y: float, yaw: float = 0.0, speed: float = 0.0) -> Block:
    """Return a van (4.6 x 1.9 x 2.2 m) on the ground, driving along its heading at `speed` m/s."""
    return Block((x, y, 1.1), (4.6, 1.9, 2.2), yaw, (speed * np.cos(yaw), speed * np.sin(yaw), 0.0))


def rider(x: float, y: float, yaw: float = 0.0, speed: float = 0.0) -> Block:
    """Return a cyclist (1.7 x 0.6 x 1.8 m) riding along its heading at `speed` m/s."""
    return Block((x, y, 0.9), (1.7, 0.6, 1.8), yaw, (speed * np.cos(yaw), speed * np.sin(yaw), 0.0))


ROADSIDE = (
    Block((-20.0, 15.0, 4.0), (18.0, 4.0, 8.0)),
    Block((0.0, 17.0, 4.0), (16.0, 4.0, 8.0)),
    Block((20.0, 15.5, 4.0), (17.0, 4.0, 8.0)),
    Block((-17.0, -16.0, 4.0), (20.0, 4.0, 8.0)),
    Block((4.0, -14.5, 4.0), (14.0, 4.0, 8.0)),
    Block((22.0, -16.5, 4.0), (15.0, 4.0, 8.0)),
    Block((34.0, 0.0, 4.0), (4.0, 30.0, 8.0)),
    Block((-32.0, 0.0, 4.0), (4.0, 30.0, 8.0)),
    van(-7.0, -7.5),
    van(1.0, -7.6),
    van(17.0, 8.0),
    Block((6.0, 7.5, 2.0), (0.4, 0.4, 4.0)),
    Block((-13.0, 7.0, 1.5), (2.5, 1.5, 3.0)),
)
TRAFFIC = (
    rider(9.0, -5.0, yaw=np.pi / 2, speed=5.0),
    rider(-9.0, 5.0, speed=6.0),
    rider(8.0, -6.0, yaw=np.pi, speed=7.0),
    rider(-6.0, -4.0, yaw=1.9, speed=4.0),
)


def street(n_scans: int = 20, traffic: Sequence[Block] = TRAFFIC, seed: int = 0) -> World:
    """Return a street seen from a vehicle at 1 m/s: houses all round, parked vans, a post, and `traffic`."""
    return record((*ROADSIDE, *traffic), drive(n_scans), seed=seed)


def lane(n_scans: int = 12) -> World:
    """Return a lane between two walls and two cyclists: hardly a second, the least in which they are found to move."""
    walls = (Block((0.0, 12.0, 3.0), (60.0, 2.0, 6.0)), Block((0.0, -12.0, 3.0), (60.0, 2.0, 6.0)))
    riders = (rider(-3.0, 5.0, speed=5.0), rider(6.0, -3.0, yaw=np.pi / 2, speed=5.0))
    return record((*walls, *riders), drive(n_scans), n_beams=16)


def drive(n_scans: int, speed: float = 1.0, turn: float = 0.02) -> np.ndarray:
    """Return (n_scans, 4, 4) T_ground_sensor of a level drive at `speed` m/s that turns by `turn` rad/s."""
    times = SCAN_GAP * np.arange(n_scans)
    poses = np.empty((n_scans, 4, 4))
    for i, t in enumerate(times):
        c, s = np.cos(turn * t), np.sin(turn * t)
        poses[i] = make_transform([[c, -s, 0], [s, c, 0], [0, 0, 1]], [speed * t, 0.0, SENSOR_HEIGHT])
    return poses


def record(blocks: Sequence[Block], T_ground_sensor: np.ndarray, n_beams: int = 24, seed: int = 0) -> World:
    """Return what a spinning sensor of `n_beams` beams (-20 to +4 degrees, 360 columns) sees along the poses."""
    rng = np.random.default_rng(seed)
    azimuth = np.radians(np.arange(0.0, 360.0))
    elevation = np.radians(np.linspace(-20.0, 4.0, n_beams))
    e, a = (grid.ravel() for grid in np.meshgrid(elevation, azimuth))
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)
    scans, truth = [], []
    for i, T in enumerate(T_ground_sensor):
        distance, hit = cast(blocks, T[:3, 3], rays @ T[:3, :3].T, SCAN_GAP * i)
        seen = distance < 70.0
        measured = distance[seen] + rng.normal(0.0, 0.01, seen.sum())
        points = (measured[:, None] * rays[seen]).astype(np.float32)
        scans.append(Scan(points, stamp=SCAN_GAP * i, name=f"{i:06d}"))
        is_moving = np.array([any(block.velocity) for block in blocks] + [False])  # the last entry is the ground
        truth.append(np.where(is_moving[hit[seen]], Label.MOVING, Label.STATIC).astype(np.uint8))
    poses = inverse(T_ground_sensor[0]) @ T_ground_sensor
    return World(ArraySequence(scans, is_compensated=True), poses, truth)


def cast(blocks: Sequence[Block], origin: np.ndarray, rays: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return each ray's (R,) distance in metres (inf: nothing hit) and (R,) row of the block hit, -1 for the ground.

    rays : (R, 3), of length 1.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        nearest = np.where(rays[:, 2] < 0.0, -origin[2] / rays[:, 2], np.inf)
        hit = np.full(len(rays), -1)
        for row, block in enumerate(blocks):
            offset = np.asarray(block.center) + time * np.asarray(block.velocity) - origin
            half = 0.5 * np.asarray(block.size)
            outside = offset @ offset - 1.001 * (half @ half)  # no ray meets a block without the ball around it
            near = np.flatnonzero(rays @ offset >= (np.sqrt(outside) if outside > 0.0 else -np.inf))
            c, s = np.cos(block.yaw), np.sin(block.yaw)
            R_block_world = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
            start, direction = (R_block_world @ -offset)[:, None], R_block_world @ rays[near].T
            one, other = (-half[:, None] - start) / direction, (half[:, None] - start) / direction
            enters, leaves = np.minimum(one, other).max(axis=0), np.maximum(one, other).min(axis=0)
            is_hit = (enters <= leaves) & (enters > 0.0) & (enters < nearest[near])
            nearest[near[is_hit]], hit[near[is_hit]] = enters[is_hit], row
    return nearest, hit


def write_bins(sequence: ArraySequence, folder: Path) -> Path:
    """Write the scans as KITTI's float32 x, y, z, intensity into `folder`; return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for scan in sequence:
        rows = np.zeros((len(scan), 4), np.float32)
        rows[:, :3] = scan.points
        rows.tofile(folder / f"{scan.name}.bin")
    return folder


def iou_of_moving(labels: Sequence[np.ndarray], truth: Sequence[np.ndarray]) -> float:
    """Return the intersection over union of the moving points, pooled over all scans."""
    said, true = (np.concatenate(list(part)) == Label.MOVING for part in (labels, truth))
    return float((said & true).sum() / max((said | true).sum(), 1))
