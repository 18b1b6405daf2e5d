"""Small whole recordings of every kind, written by the suite's own writers, for the fuzzer to damage."""

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

TESTS = Path(__file__).parents[1]
sys.path[:0] = [str(TESTS), str(TESTS / "readers")]

import point_writers as writers
from street_log import StreetLog, street_log

from automos.core.label_files import pack
from automos.core.pose_writers import write_kitti

N_SCANS = 4


def _of(module: str) -> Any:
    """Return what writes recordings of a kind; imported when used, since it may need a package that is not here."""
    return importlib.import_module(module)


def _columns(log: StreetLog, i: int) -> dict[str, np.ndarray]:
    scan = log.scans[i]
    return {**{axis: scan.points[:, k] for k, axis in enumerate("xyz")}, "intensity": scan.intensity}


def _folder_of(suffix: str, **options: object) -> Callable[[Path, StreetLog], None]:
    def write(root: Path, log: StreetLog) -> None:
        root.mkdir()
        for i in range(N_SCANS):
            writers.write_points(root / f"{i:06d}{suffix}", _columns(log, i), **options)

    return write


def _kitti(root: Path, log: StreetLog) -> None:
    (root / "velodyne").mkdir(parents=True)
    (root / "labels").mkdir()
    for i in range(N_SCANS):
        np.column_stack(list(_columns(log, i).values())).astype("<f4").tofile(root / "velodyne" / f"{i:06d}.bin")
        pack(np.full(len(log.scans[i]), 9, np.uint8)).tofile(root / "labels" / f"{i:06d}.label")
    (root / "times.txt").write_text("".join(f"{0.1 * i:.6f}\n" for i in range(N_SCANS)))
    write_kitti(root / "poses.txt", log.poses[:N_SCANS])
    (root / "calib.txt").write_text("Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n")


def _las(suffix: str) -> Callable[[Path, StreetLog], None]:
    def write(root: Path, log: StreetLog) -> None:
        root.mkdir()
        for i in range(N_SCANS):
            _of("test_las").write_las(root / f"{i:06d}{suffix}", log.scans[i])

    return write


def _npy_named(root: Path, log: StreetLog) -> None:
    root.mkdir()
    for i in range(N_SCANS):
        np.save(root / f"{i:06d}.npy", writers.table(_columns(log, i)))


def _write_bag(path: Path, log: StreetLog) -> None:
    bags = _of("bags")
    clouds = [(int(1e9 * scan.stamp), scan.stamp, bags.cloud(bags.columns_of(scan))) for scan in log.scans[:N_SCANS]]
    bags.write_bag(path, {"/points": clouds})


def _bag(name: str) -> Callable[[Path, StreetLog], None]:
    def write(root: Path, log: StreetLog) -> None:
        root.mkdir()
        _write_bag(root / name, log)

    return write


def _livox(name: str) -> Callable[[Path, StreetLog], None]:
    def write(root: Path, log: StreetLog) -> None:
        root.mkdir()
        _of("test_livox_message").write_livox(root / name, "livox_ros_driver2", log)

    return write


def _waymo(root: Path, log: StreetLog) -> None:
    root.mkdir()
    _of("test_waymo").write_segment(root)


def _ouster(root: Path, log: StreetLog) -> None:
    root.mkdir()
    _of("test_ouster").write_drive(root / "log.pcap")


def _semanticposs(root: Path, log: StreetLog) -> None:
    labels = [np.full(len(scan), 9) for scan in log.scans]
    folder = _of("test_kitti_relatives").write_sequence(root / "sequences" / "00", log, labels)
    (folder / "tag").mkdir()


def _helimos(root: Path, log: StreetLog) -> None:
    _of("test_kitti_relatives").write_sequence(root / "Deskewed_LiDAR" / "Ouster", log, log.truth)
    (root / "Deskewed_LiDAR" / "val.txt").write_text("000002\n000003\n")


def _datagrams(distance: np.ndarray, azimuth: np.ndarray) -> list[tuple[float, bytes]]:
    packets = _of("velodyne_packets").data_packets(distance, distance, azimuth)
    return [(seconds, _of("velodyne_packets").udp(packet)) for seconds, packet in packets]


def _velodyne(root: Path, log: StreetLog) -> None:
    root.mkdir()
    azimuth, _ = _of("velodyne_packets").firings(24 * 40)
    distance = np.full(azimuth.shape, 8.0)
    _of("velodyne_packets").write_pcap(root / "log.pcap", _datagrams(distance, azimuth))


BASES: dict[str, Callable[[Path, StreetLog], object]] = {
    "bin": _folder_of(".bin"),
    "npy": _folder_of(".npy"),
    "npy named": _npy_named,
    "xyz": _folder_of(".xyz"),
    "csv": _folder_of(".csv"),
    **{f"pcd {e}": _folder_of(".pcd", encoding=e) for e in ("ascii", "binary", "binary_compressed")},
    **{f"ply {e}": _folder_of(".ply", encoding=e) for e in ("ascii", "binary_little_endian", "binary_big_endian")},
    "las": _las(".las"),
    "laz": _las(".laz"),
    "kitti": _kitti,
    "kitti raw": lambda root, log: _of("test_kitti_raw").write_drive(root, log),
    "kitti tracking": lambda root, log: _of("test_kitti_tracking").write_split(root, log),
    "nuscenes": lambda root, log: _of("test_nuscenes").write_tables(root, log),
    "mulran": lambda root, log: _of("test_mulran").write_drive(root / "DCC01", log, n_points=16384),
    "helipr": lambda root, log: _of("test_helipr").write_sensor(root, "Ouster", log),
    "apollo": lambda root, log: _of("test_kitti_relatives").write_apollo(root / "run", log, writers.write_points),
    "semanticposs": _semanticposs,
    "helimos": _helimos,
    "mcap": _bag("log.mcap"),
    "bag": _bag("log.bag"),
    "db3": _bag("log.db3"),
    "bag folder": _write_bag,
    "livox bag": _livox("log.bag"),
    "livox mcap": _livox("log.mcap"),
    "argoverse 2": lambda root, log: _of("test_argoverse2").write_log(root / "7fab", log),
    "waymo": _waymo,
    "ouster": _ouster,
    "velodyne": _velodyne,
}
"""What writes a recording of each kind into a folder that is not there yet."""


def write_all(root: Path) -> dict[str, Path]:
    """Write the bases below `root`; return those that could be (their package is installed) by name."""
    root.mkdir(parents=True, exist_ok=True)
    log, made = street_log(N_SCANS), {}
    for name, write in BASES.items():
        try:
            write(root / name.replace(" ", "_"), log)
        except (ImportError, pytest.skip.Exception):
            continue
        made[name] = root / name.replace(" ", "_")
    return made
