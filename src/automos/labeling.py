"""Labels one recording into one results folder: for Python, for `automos label` and for the workers of a cluster."""

from collections.abc import Callable, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy.typing as npt
from rich.console import Console

from automos.core.arguments import require_kind
from automos.core.atomic import held
from automos.core.errors import InputError
from automos.core.own_sequence import as_sequence
from automos.core.pose_files import read_calib, read_poses
from automos.core.progress import StageProgress
from automos.core.run import Progress, silent
from automos.core.scan import Pose, Sequence
from automos.core.stages import fingerprint
from automos.core.workspace import Workspace
from automos.pipeline import Steps
from automos.result import Result
from automos.results.claiming import refuse_unrepeatable, require_room
from automos.results.run_warnings import sentences_of
from automos.results.writing import declare_whole, write_results
from automos.review.apply import reapply
from automos.review.concerns import note_concerns
from automos.review.log import key_of_changes
from automos.review.run_stages import RunStages
from automos.review.sample import note_quality
from automos.settings import Settings, given_settings


def label(
    recording: Sequence | Iterable[npt.ArrayLike],
    settings: Settings | None = None,
    *,
    poses: Pose | None = None,
    workspace: Workspace | None = None,
    workers: int = 0,
    progress: Progress | None = None,
) -> Result:
    """Label every point of every scan of `recording` as moving or static.

    Parameters
    ----------
    recording : Sequence or list of (M, 3) or (M, 4) float arrays
        A recording from `automos.open_sequence`, or one array per scan: x, y, z in metres in the sensor frame, and
        optionally the intensity. Use `automos.ArraySequence` to give the times of the scans, too.
    settings : Settings, optional
        Result of `automos.load_settings`. The default preset if not given.
    poses : (N, 4, 4) float64, optional
        T_world_sensor of each of the N scans, in metres. Estimated from the scans if not given.
    workspace : Workspace, optional
        The results folder to write, as `automos label --out` does, and to find earlier results in. If not given, a
        temporary one that goes with the result; `Result.save` keeps it.
    workers : int, default 0
        Number of processes; 0 uses one per core. The labels do not depend on it.
    progress : callable, optional
        Called as `progress(stage, done, total)` after each scan of each stage, for example `print`.

    Returns
    -------
    Result
        Labels, confidences, objects and flow of the points; objects with their boxes; the trajectory.

    Raises
    ------
    InputError
        The recording, the poses or the workspace cannot be used. The message gives the reason and the remedy.

    Examples
    --------
    >>> import numpy as np
    >>> import automos
    >>> noise = np.random.default_rng(0)
    >>> room = noise.uniform([-9, -9, -1.5], [9, 9, 2.5], (2000, 3))
    >>> scans = [room + noise.normal(0.0, 0.01, room.shape) for _ in range(10)]
    >>> result = automos.label(scans, workers=1)
    >>> print(np.count_nonzero(result.labels(0) == automos.Label.MOVING))
    0
    """
    require_kind(workspace, Workspace | None, "workspace", "automos.Workspace(folder)")
    require_kind(progress, Callable | None, "progress", "a function of stage, done and total, as print")
    sequence, chosen = as_sequence(recording), given_settings(settings)
    folder, kept = None if workspace is None else workspace.root, None
    if folder is None:
        kept = TemporaryDirectory(prefix="automos-")
        folder = Path(kept.name)
    _label_into(folder, sequence, chosen, poses, workers, progress or silent)
    return Result(folder, sequence, kept)


def label_recording(
    sequence: Sequence,
    folder: Path,
    settings: Settings,
    pose_file: Path | None = None,
    calib_file: Path | None = None,
    workers: int = 0,
    console: Console | None = None,
    waits: bool = False,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Label `sequence`, write all results into `folder`, return what run.json says of the run.

    Parameters
    ----------
    pose_file : Path, optional
        KITTI or TUM poses to use instead of odometry; the sensor's, or the camera's if `calib_file` is given.
    console : Console, optional
        Where progress bars are drawn; none without it.
    waits : bool
        For another process that writes into `folder`, instead of refusing.
    overwrite : bool
        Replace results in `folder` that were made with other poses.

    Raises
    ------
    InputError
        The recording, the poses or the folder cannot be used.
    """
    sequence = as_sequence(sequence)
    poses, may_be_cameras = given_poses(sequence, pose_file, calib_file), pose_file is not None and calib_file is None
    with StageProgress(console or Console(quiet=True), sequence.name) as progress:
        return _label_into(folder, sequence, settings, poses, workers, progress, may_be_cameras, waits, overwrite)


def _label_into(
    folder: Path,
    sequence: Sequence,
    settings: Settings,
    poses: Pose | None,
    workers: int,
    progress: Progress,
    may_be_cameras: bool = False,
    waits: bool = False,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Label `sequence` with (N, 4, 4) `poses`, which `may_be_cameras`, None for odometry, into a results folder."""
    require_room(folder, sequence)
    refuse_unrepeatable(folder)
    require_same_poses(folder, poses, overwrite)
    with held(folder, waits):
        is_whole = not key_of_changes(folder)  # a damaged log is reported before any label is touched
        found = Steps(sequence, settings, poses, Workspace(folder), workers, progress).found()
        write_results(folder, sequence, found, settings, progress, is_whole, _key_of(poses))
        del found  # who looks for places reads the same tables again
        note_concerns(RunStages(folder, sequence), may_be_cameras)
        reapply(folder, sequence, progress)
        note_quality(folder)
        return declare_whole(folder)


def require_same_poses(folder: Path, poses: Pose | None, overwrite: bool) -> None:
    """Raise InputError where `folder` holds results with other poses than (N, 4, 4) `poses`, None those of odometry."""
    run = Workspace(folder).read_run()
    if run and run.get("poses") != _key_of(poses) and not overwrite:
        raise InputError(
            f"{folder} holds results with other poses, which would be replaced: add --overwrite or choose another --out"
        )


def _key_of(poses: Pose | None) -> str | None:
    return None if poses is None else fingerprint(poses.astype(float).tobytes().hex())


def require_poses_of_one(pose_file: Path | None, calib_file: Path | None, n: int = 1, place: str = "") -> None:
    """Raise InputError if poses are given for the `n` recordings at `place`, or a calibration without poses."""
    if pose_file is None and calib_file is not None:
        raise InputError(f"--calib {calib_file} says whose the poses of a file are: give that with --poses, or neither")
    if pose_file is not None and n > 1:
        raise InputError(f"{place} holds {n} recordings, but --poses is of one: give that one")


def given_poses(sequence: Sequence, pose_file: Path | None, calib_file: Path | None) -> Pose | None:
    """Return (N, 4, 4) T_world_sensor from a KITTI or TUM file, None without one.

    The poses are the sensor's, or the camera's where `calib_file` is given; InputError if that is given alone.
    """
    require_poses_of_one(pose_file, calib_file)
    if pose_file is None:
        return None
    T_camera_sensor = None if calib_file is None else read_calib(calib_file)
    return read_poses(pose_file, len(sequence), sequence.stamps, T_camera_sensor, sequence.names)


def summary(run: dict[str, Any], folder: Path, seconds: float, was_there: bool) -> str:
    """Return a summary of a run in a few lines; `was_there` if all its results existed before."""
    points, moving = run["points"], run["tracks"]["moving"]
    total = sum(points.values())
    scans = run["recording"]["scans"]
    if was_there:
        effort = f"nothing to do: labelled before with these settings, in {sum(run['seconds'].values()):.1f} s"
    else:
        effort = f"{seconds:.1f} s, {seconds / max(scans, 1):.3f} s per scan"
    riding = run.get("points_riding_along", 0)
    on_body = f" ({riding:,} on what rides along with the sensor)" if riding else ""
    lines = [
        f"{run['recording']['name']}: {scans} scan{'s' * (scans != 1)}, {total:,} points, {points['moving']:,} moving "
        f"({100 * points['moving'] / max(total, 1):.2f} %) on {moving} object{'s' * (moving != 1)}, "
        f"{points['unlabeled']:,} unlabeled{on_body}",
        *timing_line(run),
        *(f"warning: {sentence}" for sentence in sentences_of(run)),
        f"{effort}; labels in {folder}/predictions",
    ]
    return "\n".join(lines)


def timing_line(run: dict[str, Any]) -> list[str]:
    """Return the choice of sweep timing and its next best rival as one line; no line if unknown."""
    timing = run["odometry"].get("timing")
    if timing is None:
        return []
    rivals = list(timing["worse_percent"].items())
    behind = f"; next best: {rivals[0][0]}, {rivals[0][1]:.1f} % worse" if rivals else ""
    return [f"sweep timing: {timing['chosen']}{behind}"]
