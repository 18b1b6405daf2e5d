"""Scans in the viewer while they are labelled: points, and boxes and velocities of moving objects."""

from contextlib import suppress
from typing import Any

import numpy as np

from automos.core.geometry import transform
from automos.core.labels import Label
from automos.core.scan import Scan
from automos.labeler import LabelledScan
from automos.views.rerun_layout import load_rerun, world_view
from automos.views.rerun_log import show_boxes, show_classes, show_sensor, show_velocities, thin_rows
from automos.views.topdown import verdicts
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
        show_classes(self._stream)
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
        kinds = verdicts(given.labels, None)
        is_moving = given.labels == Label.MOVING
        rest = thin_rows(np.flatnonzero(scan.is_valid & ~is_moving), self._max_static)
        rows = np.concatenate([rest, np.flatnonzero(scan.is_valid & is_moving)])
        radii = rr.Radius.ui_points(np.where(is_moving[rows], 2.4, 1.0))
        points = transform(given.pose, scan.points[rows])
        stream.log("world/points", rr.Points3D(points, class_ids=kinds[rows], radii=radii))
        show_sensor(stream, given.pose)
        objects, velocity = given.objects, given.objects["velocity"]
        speeds = np.linalg.norm(velocity, axis=1)
        texts = [f"{track} · {speed:.1f} m/s" for track, speed in zip(objects["track"], speeds, strict=True)]
        parts = objects["center"], objects["size"], objects["yaw"]
        show_boxes(stream, "world/boxes", parts, texts, with_texts=len(objects) <= MOST_LABELS)
        show_velocities(stream, objects["center"], velocity)
        stream.log("curves/moving_objects", rr.Scalars(len(given.objects)))


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
