"""Scans for Foxglove or Lichtblick while they are labelled: points with what moves, boxes, path, over a websocket.

A viewer that does not keep up would have all that waits for it kept in memory: only a few messages are.
"""

from collections import deque
from typing import Any

import numpy as np

from automos.core.geometry import quaternion_of
from automos.core.scan import Pose, Scan
from automos.labeler import LabelledScan
from automos.readers.formats import import_extra
from automos.readers.point_cloud2 import packed_rows
from automos.writers.point_columns import scan_columns

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
        place, turn = self._parts(given.pose)
        self._driven.append(self._pose(given.pose))
        self._tf.log(
            m.FrameTransform(
                timestamp=time,
                parent_frame_id=WORLD,
                child_frame_id=LIDAR,
                translation=place,
                rotation=turn,
            ),
            log_time=nanoseconds,
        )
        self._points.log(self._cloud(scan, given, time), log_time=nanoseconds)
        self._path.log(m.PosesInFrame(timestamp=time, frame_id=WORLD, poses=list(self._driven)), log_time=nanoseconds)
        self._objects.log(self._scene(given, time), log_time=nanoseconds)

    def _cloud(self, scan: Scan, given: LabelledScan, time: Any) -> Any:
        columns = {
            name: c for name, c in scan_columns(scan, scan.points).items() if name in ("x", "y", "z", "intensity")
        }
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
            c, s = np.cos(thing["yaw"]), np.sin(thing["yaw"])
            T = np.eye(4)
            T[:2, :2], T[:3, 3] = [[c, -s], [s, c]], thing["center"]
            size = m.Vector3(**dict(zip("xyz", thing["size"].tolist(), strict=True)))
            cube = m.CubePrimitive(
                pose=self._pose(T), size=size, color=m.Color(**dict(zip("rgba", _COLOR, strict=True)))
            )
            entities.append(m.SceneEntity(timestamp=time, frame_id=WORLD, id=str(thing["track"]), cubes=[cube]))
        return m.SceneUpdate(deletions=[everything], entities=entities)

    def _pose(self, T: Pose) -> Any:
        place, turn = self._parts(T)
        return self._m.Pose(position=place, orientation=turn)

    def _parts(self, T: Pose) -> tuple[Any, Any]:
        """Return the vector and the quaternion of a (4, 4) transform."""
        place, turn = T[:3, 3].tolist(), quaternion_of(T).tolist()
        vector = self._m.Vector3(**dict(zip("xyz", place, strict=True)))
        return vector, self._m.Quaternion(**dict(zip("xyzw", turn, strict=True)))
