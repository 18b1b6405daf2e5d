"""Builds the map of a recording without moving objects and writes it piece by piece."""

import json
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from automos.core.atomic import remove_parts, write_text
from automos.core.claims import METHODS, claim, remove
from automos.core.geometry import inverse
from automos.core.json_members import without_nan
from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.core.pose_writers import write_kitti
from automos.core.run import Progress, silent
from automos.core.scan import Frame, Frames, Sequence
from automos.settings import MapSettings
from automos.writers.maps.loops.closing import close_loops
from automos.writers.maps.metrics import TILE, MapCounts, MapScores, Tile, Tiles
from automos.writers.maps.writers import HeightPicture, Write, check_kind, open_cloud

_PICTURE_PIXELS = 3000
"""Of the pictures' longer side, at most: what screens show, and 9 MB at most."""


@dataclass(frozen=True)
class MadeMap:
    """The path of a map, its number of points, and its scores (None without ground truth)."""

    files: list[Path]
    n_points: int
    scores: MapScores | None


def make_map(
    frames: Frames,
    sequence: Sequence,
    labels_of: Callable[[int, int], np.ndarray],
    out: Path,
    kinds: list[str],
    settings: MapSettings,
    progress: Progress = silent,
) -> MadeMap:
    """Write the map without moving objects, a picture of it, and one of the map with all points, to the folder `out`.

    Where loops are closed, also the path that they make of the sensor's: poses.txt, as of a run.

    Parameters
    ----------
    frames, sequence : Frames and Sequence
        The recording, posed, and as it is.
    labels_of : callable
        Takes a scan's index and number of points, returns their labels (N,) of `Label`. Only points called static are
        kept.
    kinds : list of str
        "ply", "pcd", "laz": map.KIND is written for each.

    Raises
    ------
    InputError
        A kind that there is not, or a folder that cannot be written.
    """
    clouds = [out / f"map.{kind}" for kind in kinds]
    for cloud in clouds:
        check_kind(cloud)
    claim(out, METHODS)
    remove_parts(out)
    path = out / "poses.txt"
    remove(path)  # of an earlier map, whose path it was
    T_level_sensor, loops = frames.T_level_sensor, {}
    if settings.loop_closure:
        T_level_sensor, loops["loops_closed"] = close_loops(frames, settings.loops)
    with ExitStack() as stack:
        writers = [stack.enter_context(open_cloud(cloud)) for cloud in clouds]
        found = _Map(T_level_sensor[:, :3, 3], writers, settings)
        for i in range(len(sequence)):
            frame = replace(frames[i], T_level_sensor=T_level_sensor[i])
            found.add(frame, labels_of(i, frame.n_points), sequence.truth(i))
            progress("map", i + 1, len(sequence))
        scores = found.finish()
    found.raw.write(out / "map_raw.png")
    found.clean.write(out / "map_clean.png")
    if settings.loop_closure:
        write_kitti(path, inverse(T_level_sensor[0]) @ T_level_sensor)
    shares = {} if scores is None else without_nan(scores_by_name(scores))
    about = {"points": found.n_points, "voxel": settings.voxel, **loops, **shares}
    write_text(out / "map.json", json.dumps(about, indent=2) + "\n")
    files = [*clouds, out / "map_raw.png", out / "map_clean.png", out / "map.json"]
    return MadeMap([*files, path] if settings.loop_closure else files, found.n_points, scores)


class _Map:
    """A map in the making: what the sensor has left behind is written, and the pictures are drawn."""

    def __init__(self, origins: np.ndarray, writers: list[Write], settings: MapSettings):
        """Take the sensor's places (N, 3) in the level frame, and what takes the map's points."""
        self._reach = reach = settings.max_range
        corners = origins[:, :2].min(axis=0) - reach, origins[:, :2].max(axis=0) + reach
        self.raw, self.clean = (HeightPicture(*corners, _PICTURE_PIXELS) for _ in range(2))
        self.n_points = 0
        self._writers, self._has_truth = writers, False
        self._tiles, self._counts = Tiles(settings.voxel, TILE), MapCounts()

    def add(self, frame: Frame, labels: np.ndarray, truth: np.ndarray | None) -> None:
        """Add one scan; `labels` and `truth` are those of all its points."""
        used = np.flatnonzero(np.einsum("ij,ij->i", frame.points, frame.points) <= self._reach**2)
        points = frame.points_level[used]
        is_kept = labels[frame.kept][used] == Label.STATIC
        self.raw.add(points)
        self.clean.add(points[is_kept])
        self._tiles.add(points[is_kept])
        if truth is not None:
            self._has_truth = True
            true = to_mos(truth)[frame.kept][used]
            self._counts.add(points, true == Label.STATIC, true == Label.MOVING, is_kept)
        self._write(self._tiles.leave(frame.origin_level, 2.0 * self._reach))
        self._counts.leave(frame.origin_level, 2.0 * self._reach)

    def finish(self) -> MapScores | None:
        """Write what is left; return the scores, None without truth."""
        self._write(self._tiles.rest())
        return self._counts.scores() if self._has_truth else None

    def _write(self, done: Iterable[Tile]) -> None:
        for tile in done:
            self.n_points += len(tile.voxels)
            for write in self._writers:
                write(tile.voxels.mean)


def scores_by_name(scores: MapScores) -> dict[str, float]:
    """Return the six scores by their usual names, in [0, 1]."""
    return {
        "PR": scores.preservation,
        "RR": scores.rejection,
        "F1": scores.f1,
        "SA": scores.static_accuracy,
        "DA": scores.dynamic_accuracy,
        "AA": scores.associated_accuracy,
    }
