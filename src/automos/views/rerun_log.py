"""A run as entities of the viewer Rerun: points by verdict, boxes, tracks, trajectory, curves.

Everything is in the level frame (z up, metres). All moving points of a scan are shown and, if there is ground truth,
all wrongly labelled ones; static points are thinned evenly to a maximum number.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from automos.core.geometry import transform
from automos.core.labels import Label, as_probability, to_mos
from automos.core.workspace import Workspace
from automos.evaluation.moving import count
from automos.results.run_files import RunFiles
from automos.results.run_warnings import sentences_of
from automos.results.tracks_file import VERDICTS
from automos.views.rerun_layout import blueprint, load_rerun

if TYPE_CHECKING:
    import rerun

UNLABELED, STATIC, MOVING, FALSE, MISSED = range(5)
KINDS = ("unlabeled", "static", "moving", "moving, wrongly", "moving, missed")
"""What a point is shown as; the last two only where there is truth."""
COLORS = ((74, 80, 88), (150, 158, 166), (36, 214, 106), (255, 64, 68), (64, 128, 255))
VERDICT_COLORS = {"unknown": (255, 190, 60), "static": (120, 128, 136), "moving": (36, 214, 106)}
SURE = 0.7
"""Points whose confidence is lower are the entity `world/unsure`."""


def make_recording(run: RunFiles) -> rerun.RecordingStream:
    """Return an empty recording of Rerun for `run`, with the layout of its views; give it a sink, then `log_run`."""
    rr = load_rerun()
    stream = rr.RecordingStream("automos", recording_id=f"automos-{run.sequence.name}")
    stream.send_recording_name(run.sequence.name)
    return stream


def log_run(run: RunFiles, stream: rerun.RecordingStream, max_static: int) -> None:
    """Log all of `run` to `stream`, with at most `max_static` static points per scan.

    Raises
    ------
    InputError
        Label files, poses or tracks that are missing or damaged.
    """
    rr = load_rerun()
    has_truth = any(run.sequence.truth(i) is not None for i in range(len(run)))
    T_level_sensor = np.array([run.T_level_sensor(i) for i in range(len(run))])
    stream.send_blueprint(blueprint(T_level_sensor, has_truth, moving_scans(run)))
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    classes = [(k, name, color) for k, (name, color) in enumerate(zip(KINDS, COLORS, strict=True))]
    stream.log("world", rr.AnnotationContext(classes), static=True)
    stream.log("run", rr.TextDocument(_summary(run), media_type=rr.MediaType.MARKDOWN), static=True)
    for name, color in (
        ("moving_points", VERDICT_COLORS["moving"]),
        ("moving_objects", (11, 114, 133)),
        ("iou", COLORS[4]),
    ):
        stream.log(f"curves/{name}", rr.SeriesLines(colors=[color], widths=[2.0]), static=True)
    stream.log(
        "world/trajectory", rr.LineStrips3D([T_level_sensor[:, :3, 3]], colors=[235, 238, 240], radii=0.06), static=True
    )
    _log_tracks(rr, stream, run)
    for i in run.each("viewing"):
        stream.set_time("scan", sequence=i)
        stream.set_time("time", duration=float(run.stamps[i] - run.stamps[0]))
        _log_scan(rr, stream, run, i, max_static)


def moving_scans(run: RunFiles) -> tuple[int, int]:
    """Return the first and the last scan in which something moves; all scans if nothing moves."""
    moving = [track for track in run.tracks_file["tracks"] if track["verdict"] == "moving"]
    scans = [box["scan"] for track in moving for box in track["boxes"]]
    return (min(scans), max(scans)) if scans else (0, max(len(run) - 1, 0))


def _log_scan(rr: Any, stream: rerun.RecordingStream, run: RunFiles, index: int, max_static: int) -> None:
    scan = run.scan(index)
    labels = run.labels(index, len(scan))
    T_level_sensor = run.T_level_sensor(index)
    points = transform(T_level_sensor, run.points_at_pose(scan, index))
    truth = run.sequence.truth(index)
    kinds = point_kinds(labels, truth)
    shown = np.flatnonzero(scan.is_valid)
    shown = np.sort(
        np.concatenate([shown[kinds[shown] >= MOVING], thin_rows(shown[kinds[shown] < MOVING], max_static)])
    )
    radii = rr.Radius.ui_points(np.where(kinds[shown] >= MOVING, 1.8, 1.0))
    stream.log("world/points", rr.Points3D(points[shown], class_ids=kinds[shown], radii=radii))
    kept = run.stored.of_points(run.names[index], "confidence")
    if kept is not None:
        confidence = as_probability(kept)
        unsure = shown[confidence[shown] < SURE]
        amber = np.column_stack([np.full((len(unsure), 2), (255, 190)), 255 * confidence[unsure]]).astype(np.uint8)
        stream.log("world/unsure", rr.Points3D(points[unsure], colors=amber, radii=rr.Radius.ui_points(1.8)))
    stream.log("world/sensor", rr.Transform3D(translation=T_level_sensor[:3, 3], mat3x3=T_level_sensor[:3, :3]))
    stream.log("world/sensor", rr.Ellipsoids3D(half_sizes=[[0.35, 0.35, 0.35]], colors=[235, 238, 240]))
    objects = run.boxes_level(index)
    for verdict, name in enumerate(VERDICTS):
        rows = objects.verdict == verdict
        boxes = objects.boxes[rows]
        angles = [rr.RotationAxisAngle([0, 0, 1], rr.Angle(rad=float(yaw))) for yaw in boxes.yaw]
        texts = [f"{track} · {score:.2f}" for track, score in zip(objects.ids[rows], boxes.score, strict=True)]
        if name == "moving":
            speeds = np.linalg.norm(objects.velocity[rows], axis=1)
            texts = [f"{speed:.1f} m/s" for speed in speeds]
            arrows = rr.Arrows3D(
                origins=boxes.center, vectors=objects.velocity[rows], colors=VERDICT_COLORS[name], radii=0.05
            )
            stream.log("world/velocities", arrows)
        stream.log(
            f"world/boxes/{name}",
            rr.Boxes3D(
                centers=boxes.center,
                half_sizes=0.5 * boxes.size,
                rotation_axis_angles=angles,
                colors=VERDICT_COLORS[name],
                labels=texts,
                show_labels=name == "moving",
                radii=0.03,
            ),
        )
    share = 100.0 * float((labels == Label.MOVING).mean()) if len(labels) else 0.0
    stream.log("curves/moving_points", rr.Scalars(share))
    stream.log("curves/moving_objects", rr.Scalars(int((objects.verdict == VERDICTS.index("moving")).sum())))
    if truth is not None:
        iou = count(labels, truth).scores.iou
        if np.isfinite(iou):
            stream.log("curves/iou", rr.Scalars(iou))


def point_kinds(labels: npt.NDArray, truth: npt.NDArray | None) -> npt.NDArray[np.uint16]:
    """Return (N,) what each point is shown as: index into `KINDS`. Points without ground truth are never wrong."""
    kinds = np.select([labels == Label.MOVING, labels == Label.STATIC], [MOVING, STATIC], UNLABELED).astype(np.uint16)
    if truth is not None:
        true = to_mos(truth)
        kinds[(kinds == MOVING) & (true == Label.STATIC)] = FALSE
        kinds[(kinds < MOVING) & (true == Label.MOVING)] = MISSED
    return kinds


def _log_tracks(rr: Any, stream: rerun.RecordingStream, run: RunFiles) -> None:
    moving = [track for track in run.tracks_file["tracks"] if track["verdict"] == "moving" and len(track["boxes"]) > 1]
    strips = [[box["center"] for box in track["boxes"]] for track in moving]
    texts = [f"{track['id']} · {track['confidence']:.2f}" for track in moving]
    lines = rr.LineStrips3D(strips, colors=[30, 130, 80], radii=0.03, labels=texts, show_labels=False)
    stream.log("world/tracks", lines, static=True)


def thin_rows(rows: npt.NDArray[np.int64], most: int) -> npt.NDArray[np.int64]:
    """Return at most `most` of the rows, evenly."""
    return rows if len(rows) <= most else rows[np.linspace(0, len(rows) - 1, most).astype(int)]


def _summary(run: RunFiles) -> str:
    record = Workspace(run.folder).read_run()
    points = record.get("points", {})
    total = max(sum(points.values()), 1)
    legend = "green moving, grey static, dark unlabeled, red wrongly moving, blue missed"
    lines = [
        f"# {run.sequence.name}",
        f"{len(run)} scans, {total:,} points, **{100 * points.get('moving', 0) / total:.2f} % moving** on "
        f"{record.get('tracks', {}).get('moving', 0)} of {record.get('tracks', {}).get('total', 0)} objects.",
        f"Points: {legend}. Boxes show number and confidence when pointed at. Switch on `boxes/static` and `unsure` "
        "(points whose label is unsure) in the blueprint panel.",
        *(f"**Warning:** {sentence}" for sentence in sentences_of(record)),
    ]
    return "\n\n".join(lines)
