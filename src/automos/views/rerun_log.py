"""A run as entities of the viewer Rerun: points by verdict, boxes, tracks, trajectory, curves.

Everything is in the level frame (z up, metres). All moving points of a scan are shown and, if there is ground truth,
all wrongly labelled ones; static points are thinned evenly to a maximum number.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from automos.core.geometry import transform
from automos.core.labels import Label, as_probability
from automos.core.scan import Pose
from automos.core.workspace import Workspace
from automos.evaluation.moving import count
from automos.results.run_files import RunFiles
from automos.results.run_warnings import sentences_of
from automos.results.tracks_file import VERDICTS
from automos.views.ground_map import thin_rows
from automos.views.rerun_layout import blueprint, load_rerun
from automos.views.topdown import MOVING, verdicts

if TYPE_CHECKING:
    import rerun

KINDS = ("unlabeled", "static", "moving", "moving, wrongly", "moving, missed")
"""What points are called, by their verdict; the last two only where there is truth."""
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
    show_classes(stream)
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
    kinds = verdicts(labels, truth)
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
    show_sensor(stream, T_level_sensor)
    objects = run.boxes_level(index)
    for verdict, name in enumerate(VERDICTS):
        rows = objects.verdict == verdict
        boxes, velocity = objects.boxes[rows], objects.velocity[rows]
        texts = [f"{track} · {score:.2f}" for track, score in zip(objects.ids[rows], boxes.score, strict=True)]
        if name == "moving":
            texts = [f"{speed:.1f} m/s" for speed in np.linalg.norm(velocity, axis=1)]
            show_velocities(stream, boxes.center, velocity)
        parts = boxes.center, boxes.size, boxes.yaw
        show_boxes(stream, f"world/boxes/{name}", parts, texts, name, with_texts=name == "moving")
    share = 100.0 * float((labels == Label.MOVING).mean()) if len(labels) else 0.0
    stream.log("curves/moving_points", rr.Scalars(share))
    stream.log("curves/moving_objects", rr.Scalars(int((objects.verdict == VERDICTS.index("moving")).sum())))
    if truth is not None:
        iou = count(labels, truth).scores.iou
        if np.isfinite(iou):
            stream.log("curves/iou", rr.Scalars(iou))


def show_classes(stream: rerun.RecordingStream) -> None:
    """Say in which colours points are shown, by what they are, and which way is up."""
    rr = load_rerun()
    classes = [(k, name, color) for k, (name, color) in enumerate(zip(KINDS, COLORS, strict=True))]
    stream.log("world", rr.AnnotationContext(classes), rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)


def show_sensor(stream: rerun.RecordingStream, T_level_sensor: Pose) -> None:
    """Show where the sensor is."""
    rr = load_rerun()
    stream.log("world/sensor", rr.Transform3D(translation=T_level_sensor[:3, 3], mat3x3=T_level_sensor[:3, :3]))
    stream.log("world/sensor", rr.Ellipsoids3D(half_sizes=[[0.35, 0.35, 0.35]], colors=[235, 238, 240]))


def show_boxes(
    stream: rerun.RecordingStream,
    where: str,
    objects: tuple[npt.NDArray, npt.NDArray, npt.NDArray],
    texts: list[str],
    verdict: str = "moving",
    with_texts: bool = True,
) -> None:
    """Show K boxes as the entity `where`: centre (K, 3), size (K, 3) and yaw (K,) of each, upright, in the level frame.

    Of more than fit, `texts` are shown where one points only: not `with_texts`.
    """
    rr, (center, size, yaw) = load_rerun(), objects
    boxes = rr.Boxes3D(
        centers=center,
        half_sizes=0.5 * size,
        rotation_axis_angles=[rr.RotationAxisAngle([0, 0, 1], rr.Angle(rad=float(angle))) for angle in yaw],
        colors=VERDICT_COLORS[verdict],
        labels=texts,
        show_labels=with_texts,
        radii=0.03,
    )
    stream.log(where, boxes)


def show_velocities(stream: rerun.RecordingStream, center: npt.NDArray, velocity: npt.NDArray) -> None:
    """Show the velocities (K, 3) of what moves as arrows from `center` (K, 3)."""
    arrows = load_rerun().Arrows3D(origins=center, vectors=velocity, colors=VERDICT_COLORS["moving"], radii=0.05)
    stream.log("world/velocities", arrows)


def _log_tracks(rr: Any, stream: rerun.RecordingStream, run: RunFiles) -> None:
    moving = [track for track in run.tracks_file["tracks"] if track["verdict"] == "moving" and len(track["boxes"]) > 1]
    strips = [[box["center"] for box in track["boxes"]] for track in moving]
    texts = [f"{track['id']} · {track['confidence']:.2f}" for track in moving]
    lines = rr.LineStrips3D(strips, colors=[30, 130, 80], radii=0.03, labels=texts, show_labels=False)
    stream.log("world/tracks", lines, static=True)


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
