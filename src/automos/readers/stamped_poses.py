"""Poses that came with a recording, on a clock of their own or as quaternions; and where LiDARs of a merged cloud sit.

`mounts.yaml` in a recording's folder names each LiDAR, in the order of their numbers in the points' column `sensor`
(or `lidar`, `lidar_id`, `sensor_id`), or with the rings, first and last, that are its own:

    - {name: roof, rings: [0, 63], translation: [0, 0, 0]}
    - {name: rear, rings: [64, 79], translation: [-3.2, 0, -0.4], rotation: [0, 0, 1, 0]}    # x y z w
    - {name: left, rings: [80, 95], T_scan_sensor: [[...], [...], [...], [0, 0, 0, 1]]}
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import FARTHEST, Array, inverse, is_rigid, make_transform, with_exact_rotations
from automos.core.pose_files import MAX_SKEW, interpolate_poses, nearest_gap
from automos.core.reading import damage_reported, is_there, parse_yaml, read_text
from automos.core.scan import Ints, Pose, Scan

_HOLE = 1.0
"""Seconds from the nearest pose beyond which a scan's is not known: in that time a vehicle turns off."""
_NO_POSE = (
    "{} holds a pose that is none, is not on Earth, or whose rotation is scaled, sheared or mirrored; copy it again"
)


def from_quaternions(translation: npt.ArrayLike, xyzw: npt.ArrayLike, path: Path) -> Pose:
    """Return the (N, 4, 4) transforms of translations (N, 3), metres, and quaternions (N, 4), scalar last.

    Raises
    ------
    InputError
        Quaternions that are not of length one, or places that are not on Earth; `path` is what they came from.
    """
    from scipy.spatial.transform import Rotation

    translation = np.atleast_2d(np.asarray(translation, np.float64))
    xyzw = np.atleast_2d(np.asarray(xyzw, np.float64))
    if not ((np.abs(np.linalg.norm(xyzw, axis=1) - 1.0) <= MAX_SKEW).all() and (np.abs(translation) < FARTHEST).all()):
        raise InputError(_NO_POSE.format(path))
    return make_transform(Rotation.from_quat(xyzw).as_matrix(), translation)


def from_rotations(R: Array, translation: Array, path: Path) -> Pose:
    """Return the (N, 4, 4) transforms of (N, 3, 3) and (N, 3); errors are those of `rigid_transforms`."""
    return rigid_transforms(make_transform(R, translation), path)


def from_rows(rows: Array, path: Path) -> Pose:
    """Return the (N, 4, 4) transforms of their first three rows, (N, 12); errors are those of `rigid_transforms`."""
    three = rows.reshape(-1, 3, 4)
    return from_rotations(three[..., :3], three[..., 3], path)


def rigid_transforms(T: npt.ArrayLike, path: Path) -> Pose:
    """Return transforms (N, 4, 4) with the nearest exact rotations; files round them.

    Raises
    ------
    InputError
        One is none, or not on Earth; `path` is what they came from.
    """
    T = np.array(T, np.float64)
    if not ((np.abs(T) < FARTHEST).all() and is_rigid(T, MAX_SKEW).all()):
        raise InputError(_NO_POSE.format(path))
    return with_exact_rotations(T)


def poses_at(stamps: Array, pose_stamps: Array, T_map_body: Pose, path: Path) -> Pose:
    """Return (N, 4, 4) `T_map_body` at scan times `stamps` (N,), interpolated between `pose_stamps` (M,) seconds.

    Raises
    ------
    InputError
        The poses do not reach a scan: they begin later or end earlier by more than half the time between scans, or
        there are none for a while.
    """
    if len(pose_stamps) == 0:
        raise InputError(f"{path} holds no poses")
    order = np.argsort(pose_stamps, kind="stable")
    order = order[np.r_[True, np.diff(pose_stamps[order]) > 0]]
    times, T = pose_stamps[order], T_map_body[order]
    slack = 0.5 * float(np.median(np.diff(stamps))) if len(stamps) > 1 else 0.05
    apart = nearest_gap(stamps, times)
    is_outside = (stamps < times[0] - slack) | (stamps > times[-1] + slack)
    has_none = is_outside if is_outside.any() else apart > _HOLE
    if has_none.any():
        scan = int(np.argmax(has_none))
        reach = f"its poses are from {times[0]:.6f} to {times[-1]:.6f}; it belongs to another recording or is not whole"
        hole = f"the nearest is {apart[scan]:.2f} s away; it is not whole: copy it again"
        why = reach if is_outside.any() else hole
        raise InputError(f"{path} has no pose for scan {scan} (time {stamps[scan]:.6f}): {why}")
    return interpolate_poses(times, T, stamps)


def truth_beside(folder: Path, name: str) -> Path | None:
    """Return the file of poses that VBR publishes with the recording `name` in `folder`: campus_train0_gt.txt."""
    found = sorted(folder.glob("*_gt.txt"))
    return next((path for path in found if name.startswith(path.name.removesuffix("_gt.txt"))), None)


def sensor_poses(T_map_body: Pose, T_body_sensor: npt.ArrayLike | None = None) -> Pose:
    """Return (N, 4, 4) T_world_sensor, the world being the first scan's sensor frame, from a body's poses in a map."""
    T = T_map_body if T_body_sensor is None else T_map_body @ np.asarray(T_body_sensor, np.float64)
    return inverse(T[0]) @ T


FILE = "mounts.yaml"
_KEYS = {"name", "rings", "translation", "rotation", "T_scan_sensor"}


@dataclass(frozen=True, eq=False)
class Mounts:
    """The LiDARs of a merged cloud.

    Attributes
    ----------
    names : K.
    T_scan_sensor : (K, 4, 4).
    rings : (K, 2) the first and last ring of each; None where a column of the points says which LiDAR they are from.
    """

    names: list[str]
    T_scan_sensor: Pose
    rings: Ints | None = None

    def applied_to(self, scan: Scan, sensor: npt.NDArray | None, where: Path) -> Scan:
        """Return `scan` with the LiDAR of each point, from its column `sensor` (N,) or from its ring.

        Raises
        ------
        InputError
            Points that say nothing of where they are from, or are of a LiDAR without a mount.
        """
        if len(scan) == 0:
            sensor = np.zeros(0, np.int64)  # a file without points may have no columns either
        elif self.rings is not None and scan.ring is not None:
            sensor = np.full(len(scan), len(self.names), np.int64)
            for k, (first, last) in enumerate(self.rings):
                sensor[(scan.ring >= first) & (scan.ring <= last)] = k
        elif sensor is None:
            what = "rings" if self.rings is not None else "column 'sensor', and its mounts no rings"
            raise InputError(f"{where} has no {what}: nothing says which of {', '.join(self.names)} measured a point")
        stray = sensor >= len(self.names)
        if stray.any():
            row = int(np.argmax(stray))
            raise InputError(f"{where}: point {row} is of none of the mounted LiDARs {', '.join(self.names)}")
        return replace(scan, sensor=sensor.astype(np.uint8), T_scan_sensor=self.T_scan_sensor)


def checked_mount(T: npt.ArrayLike, name: str, where: Path) -> Pose:
    """Return (4, 4) `T`, its rotation made exact.

    Raises
    ------
    InputError
        `T` is not a rigid transform.
    """
    try:
        T = np.asarray(T, np.float64)
    except (TypeError, ValueError):
        T = np.zeros((0, 0))
    if T.shape != (4, 4) or not is_rigid(T):
        raise InputError(
            f"{where}: the mount of {name} is not a rigid transform: give 4 x 4 numbers, rotation and translation in "
            "metres only, without scale or mirroring"
        )
    return with_exact_rotations(T)


def read_mounts(folder: Path) -> Mounts | None:
    """Return the mounts that `mounts.yaml` in `folder` holds, None without one.

    Raises
    ------
    InputError
        A file that cannot be read as mounts, or a mount that is not a rigid transform.
    """
    path = folder / FILE
    if not is_there(path):
        return None
    with damage_reported(path, "is not YAML", "correct it"):
        entries = parse_yaml(read_text(path))
    if not isinstance(entries, list) or not 0 < len(entries) <= 255 or not all(isinstance(e, dict) for e in entries):
        raise InputError(f"{path} must be a list of LiDARs, each with a name and where it sits; see the documentation")
    names = [str(entry.get("name", k)) for k, entry in enumerate(entries)]
    T = np.stack([_transform_of(entry, name, path) for entry, name in zip(entries, names, strict=True)])
    rings = [entry.get("rings") for entry in entries]
    return Mounts(names, T, None if all(ring is None for ring in rings) else _checked_rings(rings, names, path))


def _checked_rings(rings: list[Any], names: list[str], path: Path) -> Ints:
    """Return (K, 2) the first and last ring of each LiDAR; InputError where they are none, or one has two LiDARs."""
    for ring, name in zip(rings, names, strict=True):
        is_pair = isinstance(ring, list) and len(ring) == 2 and all(r in range(1 << 16) for r in ring)
        if not is_pair or ring[0] > ring[1]:
            raise InputError(f"{path}: the rings of {name} must be its first and last, [0, 31], but are {ring!r:.80}")
    order = sorted(range(len(rings)), key=lambda k: rings[k])
    for one, next_one in pairwise(order):
        if rings[next_one][0] <= rings[one][1]:
            shared = rings[next_one][0]
            raise InputError(f"{path}: ring {shared} is of both {names[one]} and {names[next_one]}; give it to one")
    return np.array(rings, np.int64)


def _transform_of(entry: dict[str, Any], name: str, path: Path) -> Pose:
    from scipy.spatial.transform import Rotation

    unknown = set(entry) - _KEYS
    if unknown:
        raise InputError(f"{path}: {name} has {min(unknown)!r}, but a mount has {', '.join(sorted(_KEYS))}")
    if "T_scan_sensor" in entry:
        return checked_mount(entry["T_scan_sensor"], name, path)
    with damage_reported(
        f"{path}: {name}", "needs a translation of 3 numbers and a rotation of 4, x y z w", "correct it"
    ):
        place = np.asarray(entry.get("translation", [0.0, 0.0, 0.0]), np.float64).reshape(3)
        xyzw = np.asarray(entry.get("rotation", [0.0, 0.0, 0.0, 1.0]), np.float64).reshape(4)
    if not abs((length := np.linalg.norm(xyzw)) - 1.0) < 0.01:
        raise InputError(f"{path}: the mount of {name} is not a rigid transform: its quaternion has norm {length:.3g}")
    return checked_mount(make_transform(Rotation.from_quat(xyzw).as_matrix(), place), name, path)
