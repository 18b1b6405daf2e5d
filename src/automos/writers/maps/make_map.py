"""Builds the map of a recording without moving objects and writes it piece by piece."""

import json
import math
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import remove_parts, write_text
from automos.core.claims import METHODS, claim
from automos.core.geometry import inverse
from automos.core.labels import Label, to_mos
from automos.core.pose_writers import write_kitti
from automos.core.run import Progress
from automos.core.scan import Frames, Sequence
from automos.settings import MapSettings
from automos.writers.maps.loops.closing import FramesAt, close_loops
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
    labels_of: Callable[[int, int], npt.NDArray],
    out: Path,
    kinds: list[str],
    settings: MapSettings,
    progress: Progress | None = None,
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
    about: dict[str, object] = {"voxel": settings.voxel}
    files = [*clouds, out / "map_raw.png", out / "map_clean.png", out / "map.json"]
    if settings.loop_closure:
        T_level_sensor, about["loops_closed"] = close_loops(frames, settings.loops)
        frames = FramesAt(frames, T_level_sensor)
        files.append(out / "poses.txt")
        write_kitti(files[-1], inverse(T_level_sensor[0]) @ T_level_sensor)
    reach, origins = settings.max_range, frames.T_level_sensor[:, :3, 3]
    corners = origins[:, :2].min(axis=0) - reach, origins[:, :2].max(axis=0) + reach
    raw, clean = (HeightPicture(*corners, _PICTURE_PIXELS) for _ in range(2))
    with ExitStack() as stack:
        writers = [stack.enter_context(open_cloud(cloud)) for cloud in clouds]
        n_points, scores = _write_map(frames, sequence, labels_of, writers, (raw, clean), settings, progress)
    raw.write(out / "map_raw.png")
    clean.write(out / "map_clean.png")
    named = {} if scores is None else scores_by_name(scores)
    about |= {"points": n_points} | {name: None if math.isnan(score) else score for name, score in named.items()}
    write_text(out / "map.json", json.dumps(about, indent=2) + "\n")
    return MadeMap(files, n_points, scores)


def _write_map(
    frames: Frames,
    sequence: Sequence,
    labels_of: Callable[[int, int], npt.NDArray],
    writers: list[Write],
    pictures: tuple[HeightPicture, HeightPicture],
    settings: MapSettings,
    progress: Progress | None,
) -> tuple[int, MapScores | None]:
    """Give the map's points to `writers`, all points and those kept to `pictures`; return points, scores."""
    reach, (raw, clean) = settings.max_range, pictures
    tiles, counts, n_points, has_truth = Tiles(settings.voxel, TILE), MapCounts(), 0, False

    def finish(done: Iterable[Tile]) -> None:
        nonlocal n_points
        for tile in done:
            n_points += len(tile.voxels)
            for write in writers:
                write(tile.voxels.mean)

    for i in range(len(sequence)):
        frame = frames[i]
        used = np.flatnonzero(np.einsum("ij,ij->i", frame.points, frame.points) <= reach**2)
        points = frame.points_level[used]
        is_kept = labels_of(i, frame.n_points)[frame.kept][used] == Label.STATIC
        raw.add(points)
        clean.add(points[is_kept])
        tiles.add(points[is_kept])
        truth = sequence.truth(i)
        if truth is not None:
            has_truth = True
            true = to_mos(truth)[frame.kept][used]
            counts.add(points, true == Label.STATIC, true == Label.MOVING, is_kept)
        finish(tiles.leave(frame.origin_level, 2.0 * reach))
        counts.leave(frame.origin_level, 2.0 * reach)
        if progress is not None:
            progress("map", i + 1, len(sequence))
    finish(tiles.rest())
    return n_points, counts.scores() if has_truth else None


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
