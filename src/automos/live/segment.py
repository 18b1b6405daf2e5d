"""`automos segment`: labels a recording online, as on a robot, with results like those of `automos label`."""

import time
from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from automos import __version__
from automos.core.geometry import inverse
from automos.core.run import Progress
from automos.core.scan import Scan, Sequence
from automos.core.workspace import write_run
from automos.labeler import Labeler, LabelledScan
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.trajectory import Trajectory
from automos.results.claiming import claimed
from automos.results.point_files import count_points, no_points, write_points
from automos.results.tracks_file import box_entry
from automos.results.writing import about, write_tables
from automos.settings import Settings


class ResultsWriter:
    """Writes scans as they are returned: labels at once, results of all scans at the end."""

    def __init__(self, folder: Path, names: list[str] | None, settings: Settings):
        """Take a claimed results folder, and the scans' names, or None to use their numbers."""
        self._folder, self._names, self._settings = folder, names, settings
        self._written: list[str] = []
        self._poses: list[np.ndarray] = []
        self._stamps: list[float] = []
        # Of each track and scan: number of the scan, stamp, confidence, box. As plain numbers, since a sensor may send
        # for days, and tracks.json has all scans of a track in one place.
        self._objects: dict[int, array[float]] = {}
        self._counts = no_points()

    def write(self, given: LabelledScan) -> None:
        """Write one scan; call in the order of the scans."""
        name = f"{given.index:06d}" if self._names is None else self._names[given.index]
        output, track_ids, confidence = self._settings.output, given.track_ids, given.confidence
        kept = track_ids if output.track_ids else None, confidence if output.confidence else None
        write_points(self._folder, name, given.labels, *kept)
        count_points(self._counts, given.labels)
        for row in given.objects:
            track = int(row["track"])
            columns = np.hstack([row["center"], row["size"], row["yaw"], row["velocity"]]).round(3).tolist()
            sure = float(confidence[track_ids == track].mean())
            of_track = self._objects.setdefault(track, array("d"))
            of_track.extend([len(self._written), round(given.stamp, 6), sure, *columns])
        self._written.append(name)
        self._poses.append(given.pose)
        self._stamps.append(given.stamp)

    def finish(self, note: dict[str, Any]) -> dict[str, Any]:
        """Write the results of all scans, and run.json including `note`; return its contents."""
        T_level_sensor = np.array(self._poses).reshape(-1, 4, 4)
        T_level_world = T_level_sensor[0] if len(T_level_sensor) else np.eye(4)
        poses, stamps = inverse(T_level_world) @ T_level_sensor, np.array(self._stamps)
        trajectory = Trajectory(poses, stamps, np.zeros((len(poses), 6)), SweepTiming(), T_level_world)
        write_tables(self._folder, trajectory, self._settings, self._written, self._entries())
        tracks = {"total": len(self._objects), "moving": len(self._objects)}
        run = {**note, "points": self._counts, "tracks": tracks, "versions": {"automos": __version__}}
        write_run(self._folder, run)
        return run

    def _entries(self) -> Iterator[dict[str, Any]]:
        for track, numbers in sorted(self._objects.items()):
            rows = np.frombuffer(numbers).reshape(-1, 13)
            boxes = [box_entry(int(scan), stamp, True, columns) for scan, stamp, _, *columns in rows.tolist()]
            confidence = round(float(rows[:, 2].mean()), 3)
            yield {"id": track + 1, "verdict": "moving", "confidence": confidence, "boxes": boxes}


@contextmanager
def results_writer(
    folder: Path, names: list[str] | None, settings: Settings, recording: Sequence | None = None
) -> Iterator[ResultsWriter]:
    """Yield a writer with exclusive access to `folder` until the block ends; errors as in `claimed`."""
    places = ["predictions", *(["confidences"] if settings.output.confidence else [])]
    with claimed(folder, places, recording):
        yield ResultsWriter(folder, names, settings)


def segment_recording(
    sequence: Sequence, folder: Path, settings: Settings, lag: float = 0.0, progress: Progress | None = None
) -> dict[str, Any]:
    """Label every scan of `sequence` with a lag of `lag` seconds; return the contents of run.json.

    Labels, poses, tracks.json and run.json are written to `folder`.

    Raises
    ------
    InputError : the folder contains another program's labels, or cannot be written.
    """
    labeler = Labeler(settings, lag=lag, is_compensated=sequence.is_compensated)
    milliseconds = []
    with results_writer(folder, sequence.names, settings, sequence) as writer:
        start = time.perf_counter()
        for i, done in enumerate(labeler.push_each(stamped(sequence))):
            milliseconds.append(1e3 * (time.perf_counter() - start))
            start = time.perf_counter()
            for given in done:
                writer.write(given)
            if progress is not None:
                progress("segment", i + 1, len(sequence))
        for given in labeler.finish():
            writer.write(given)
        median, p99 = np.percentile(milliseconds, [50, 99]).round(2).tolist()
        spent = {"median": median, "p99": p99}
        return writer.finish({"recording": about(sequence), "lag_seconds": lag, "milliseconds": {"all": spent}})


def stamped(sequence: Sequence) -> Iterator[Scan]:
    """Yield the scans with the recording's clock."""
    stamps = sequence.stamps
    for i in range(len(sequence)):
        scan = sequence[i]
        yield scan if stamps is None else replace(scan, stamp=float(stamps[i]))


def summary(run: dict[str, Any], folder: Path) -> str:
    """Return a summary of a few lines for a terminal."""
    points = run["points"]
    total, spent = max(sum(points.values()), 1), run["milliseconds"]["all"]
    return (
        f"{run['recording']['name']}: {run['recording']['scans']} scans, {total:,} points, {points['moving']:,} moving "
        f"({100 * points['moving'] / total:.2f} %) on {run['tracks']['moving']} objects, "
        f"{points['unlabeled']:,} not known\n"
        f"lag {run['lag_seconds']:g} s, ms a scan, median/p99: {spent['median']:.0f}/{spent['p99']:.0f}\n"
        f"labels in {folder}/predictions"
    )
