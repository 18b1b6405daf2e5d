"""Scans while they are labelled, in our viewer, in Foxglove or Lichtblick: points with what moves, boxes, path.

A viewer that does not keep up would have all that waits for it kept in memory: only a few messages are.
"""

from collections import deque
from contextlib import suppress
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.extras import import_extra
from automos.core.geometry import quaternion_of, transform, upright_pose
from automos.core.labels import Label
from automos.core.scan import Pose, Scan
from automos.labeler import LabelledScan
from automos.readers.point_cloud2 import packed_rows
from automos.views.ground_map import thin_rows
from automos.views.rerun_layout import laid_out, load_rerun, world_view
from automos.views.rerun_log import show_boxes, show_classes, show_sensor, show_velocities
from automos.views.topdown import verdicts
from automos.views.viewer import Viewer
from automos.writers.formats import scan_columns

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
    return laid_out(rrb, rrb.Vertical(world, curve, row_shares=[5, 1]), play_state="Following")


WORLD, LIDAR = "world", "lidar"
_BACKLOG = 8
"""Messages that wait for a viewer: two scans."""
_PATH = 1000
"""Poses of the path that are shown."""
_COLOR = (0.9, 0.3, 0.3, 0.5)


class FoxgloveView:
    """A server on 127.0.0.1 to which viewers connect."""

    def __init__(self, name: str, port: int = 0):
        """Start it at `port`, 0 for any free one.

        Raises
        ------
        MissingExtraError : foxglove-sdk is not installed.
        OSError : the port is taken.
        """
        sdk, channels = import_extra("foxglove", "foxglove"), import_extra("foxglove.channels", "foxglove")
        self._m = import_extra("foxglove.messages", "foxglove")
        self._context = context = sdk.Context()  # without which its channels end
        self._server = sdk.start_server(name=name, port=port, message_backlog_size=_BACKLOG, context=context)
        self._points = channels.PointCloudChannel("/points", context=context)
        self._objects = channels.SceneUpdateChannel("/objects", context=context)
        self._tf = channels.FrameTransformChannel("/tf", context=context)
        self._path = channels.PosesInFrameChannel("/path", context=context)
        self._driven: deque[Any] = deque(maxlen=_PATH)
        self.url = f"ws://127.0.0.1:{self._server.port}"

    def close(self) -> None:
        """End the server."""
        self._server.stop()

    def show(self, scan: Scan, given: LabelledScan) -> None:
        """Send a scan and its labels."""
        m, nanoseconds = self._m, max(round(1e9 * given.stamp), 0)
        time = m.Timestamp(sec=nanoseconds // 10**9, nsec=nanoseconds % 10**9)
        where = {"translation": self._vector(given.pose[:3, 3]), "rotation": self._turn(given.pose)}
        self._driven.append(self._pose(given.pose))
        for channel, message in (
            (
                self._tf,
                m.FrameTransform(timestamp=time, parent_frame_id=WORLD, child_frame_id=LIDAR, **where),
            ),
            (self._points, self._cloud(scan, given, time)),
            (self._path, m.PosesInFrame(timestamp=time, frame_id=WORLD, poses=list(self._driven))),
            (self._objects, self._scene(given, time)),
        ):
            channel.log(message, log_time=nanoseconds)

    def _cloud(self, scan: Scan, given: LabelledScan, time: Any) -> Any:
        found = scan_columns(scan, scan.points)
        columns = {name: column for name, column in found.items() if name not in ("time", "ring")}
        columns |= {"label": given.labels, "track": (given.track_ids + 1).astype(np.uint32)}
        rows = packed_rows({name: column[scan.is_valid] for name, column in columns.items()})
        kinds = {"f4": "Float32", "u1": "Uint8", "u4": "Uint32"}
        types = self._m.PackedElementFieldNumericType
        fields = [
            self._m.PackedElementField(
                name=name,
                offset=rows.dtype.fields[name][1],  # type: ignore[index]
                type=getattr(types, kinds[rows.dtype[name].str[1:]]),
            )
            for name in columns
        ]
        return self._m.PointCloud(
            timestamp=time,
            frame_id=LIDAR,
            pose=self._pose(np.eye(4)),
            point_stride=rows.dtype.itemsize,
            fields=fields,
            data=rows.tobytes(),
        )

    def _scene(self, given: LabelledScan, time: Any) -> Any:
        m = self._m
        everything = m.SceneEntityDeletion(timestamp=time, type=m.SceneEntityDeletionType.All)
        entities = []
        for thing in given.objects:
            T = upright_pose((np.cos(thing["yaw"]), np.sin(thing["yaw"])), thing["center"])
            size, color = self._vector(thing["size"]), m.Color(**dict(zip("rgba", _COLOR, strict=True)))
            cube = m.CubePrimitive(pose=self._pose(T), size=size, color=color)
            entities.append(m.SceneEntity(timestamp=time, frame_id=WORLD, id=str(thing["track"]), cubes=[cube]))
        return m.SceneUpdate(deletions=[everything], entities=entities)

    def _pose(self, T: Pose) -> Any:
        return self._m.Pose(position=self._vector(T[:3, 3]), orientation=self._turn(T))

    def _turn(self, T: Pose) -> Any:
        return self._m.Quaternion(**dict(zip("xyzw", quaternion_of(T).tolist(), strict=True)))

    def _vector(self, values: npt.NDArray) -> Any:
        return self._m.Vector3(**dict(zip("xyz", values.tolist(), strict=True)))
