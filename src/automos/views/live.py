"""Scans in the viewer while they are labelled: points, and boxes and velocities of moving objects."""

from contextlib import suppress
from typing import Any

import numpy as np

from automos.core.geometry import transform
from automos.core.labels import Label
from automos.core.scan import Pose, Scan
from automos.labeler import LabelledScan
from automos.views.rerun_layout import load_rerun, world_view
from automos.views.rerun_log import COLORS, KINDS, VERDICT_COLORS, point_kinds, thin_rows
from automos.views.viewer import Viewer

EYE = (-28.0, 0.0, 24.0)
"""Where the eye is, metres from the first scan's sensor: behind and above; it goes along."""

MOST_LABELS = 10
"""Of more objects than these the texts would hide the points; they are shown where one points."""


class LiveView:
    """A viewer that shows the latest labelled scan."""

    def __init__(self, viewer: Viewer, name: str, max_static: int):
        """Take a running viewer, what to call it, and how many static points a scan are shown at most."""
        rr = load_rerun()
        self._rr, self._viewer, self._max_static = rr, viewer, max_static
        self._stream = rr.RecordingStream("automos", recording_id=f"automos-live-{name}")
        viewer.connect(self._stream)
        self._stream.send_recording_name(f"{name}, live")
        self._stream.send_blueprint(_blueprint(rr))
        classes = [(k, kind, color) for k, (kind, color) in enumerate(zip(KINDS, COLORS, strict=True))]
        self._stream.log("world", rr.AnnotationContext(classes), rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._first_stamp: float | None = None

    @property
    def is_open(self) -> bool:
        """Whether the viewer still runs."""
        return self._viewer.is_open

    def close(self) -> None:
        """Send the rest, and disconnect from the viewer."""
        if self.is_open:
            with suppress(RuntimeError):  # the viewer does not take it in time
                self._stream.flush(timeout_sec=2.0)
        self._stream.disconnect()

    def show(self, scan: Scan, given: LabelledScan) -> None:
        """Show a scan and its labels, unless the viewer was closed."""
        if not self.is_open:
            return
        rr, stream = self._rr, self._stream
        self._first_stamp = given.stamp if self._first_stamp is None else self._first_stamp
        stream.set_time("scan", sequence=given.index)
        stream.set_time("time", duration=given.stamp - self._first_stamp)
        kinds = point_kinds(given.labels, None)
        is_moving = given.labels == Label.MOVING
        rest = thin_rows(np.flatnonzero(scan.is_valid & ~is_moving), self._max_static)
        rows = np.concatenate([rest, np.flatnonzero(scan.is_valid & is_moving)])
        radii = rr.Radius.ui_points(np.where(is_moving[rows], 2.4, 1.0))
        points = transform(given.pose, scan.points[rows])
        stream.log("world/points", rr.Points3D(points, class_ids=kinds[rows], radii=radii))
        self._show_sensor(given.pose)
        self._show_objects(given.objects)
        stream.log("curves/moving_objects", rr.Scalars(len(given.objects)))

    def _show_sensor(self, pose: Pose) -> None:
        rr = self._rr
        self._stream.log("world/sensor", rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        self._stream.log("world/sensor", rr.Ellipsoids3D(half_sizes=[[0.35, 0.35, 0.35]], colors=[235, 238, 240]))

    def _show_objects(self, objects: Any) -> None:
        rr, color = self._rr, VERDICT_COLORS["moving"]
        speeds = np.linalg.norm(objects["velocity"], axis=1)
        angles = [rr.RotationAxisAngle([0, 0, 1], rr.Angle(rad=float(yaw))) for yaw in objects["yaw"]]
        boxes = rr.Boxes3D(
            centers=objects["center"],
            half_sizes=0.5 * objects["size"],
            rotation_axis_angles=angles,
            colors=color,
            labels=[f"{track} · {speed:.1f} m/s" for track, speed in zip(objects["track"], speeds, strict=True)],
            show_labels=len(objects) <= MOST_LABELS,
            radii=0.03,
        )
        self._stream.log("world/boxes", boxes)
        arrows = rr.Arrows3D(origins=objects["center"], vectors=objects["velocity"], colors=color, radii=0.05)
        self._stream.log("world/velocities", arrows)


def _blueprint(rr: Any) -> Any:
    rrb = rr.blueprint
    world = world_view(rrb, EYE, (6.0, 0.0, 0.0))
    curve = rrb.TimeSeriesView(name="objects that move", origin="/curves/moving_objects")
    return rrb.Blueprint(
        rrb.Vertical(world, curve, row_shares=[5, 1]),
        rrb.TimePanel(state="collapsed", timeline="scan", play_state="Following"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
