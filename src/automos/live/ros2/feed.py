"""The node as a source of scans: the latest cloud of a topic, subscribed with the quality that its publishers offer.

Clouds of two megabytes are lost where a subscription asks for best effort, ROS's default for sensors, and transport is
not set up for them; and none comes where it asks for more than is offered. So it is reliable if all publishers are.
Clouds are changed as bytes, for messages of whoever decoded them.
"""

from __future__ import annotations

import array
import logging
import time
from collections import OrderedDict
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError, MissingExtraError
from automos.core.labels import Label
from automos.core.scan import Scan
from automos.live.feed import ROOM, Feed
from automos.readers.columns import to_scan
from automos.readers.point_cloud2 import cells_of, read_columns

_log = logging.getLogger(__name__)

TOPIC = "points"
LOOK = 0.5
"""Seconds between two looks at who publishes."""
SILENCE = 5.0
"""Seconds without a cloud, though somebody publishes, after which a warning says so."""
FIELD = "moving"
STATIC, MOVING, UNKNOWN = 0, 1, 2
"""What the field says: a point that is not known may come to move, or has no return."""
_UINT8 = 2


class Body(NamedTuple):
    """What of a PointCloud2 changes with its points."""

    height: int
    width: int
    point_step: int
    row_step: int
    data: array.array[int]


def scan_of(message: Any, name: str) -> Scan:
    """Return the scan that a PointCloud2 holds, stamped by its header; InputError where it holds none."""
    stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
    return to_scan(read_columns(message, name), name, name, stamp)  # type: ignore[arg-type]


def with_field(message: Any, labels: npt.NDArray) -> Body:
    """Return the points of `message` with one byte more each: `STATIC`, `MOVING` or `UNKNOWN`.

    labels : (N,) of `Label`, in the message's order, which is kept; so are rows and columns.
    """
    cells = cells_of(message, "a message")
    rows = cells.reshape(-1, cells.shape[2])
    wider = np.empty((len(rows), rows.shape[1] + 1), np.uint8)
    wider[:, :-1] = rows
    wider[:, -1] = np.select([labels == Label.MOVING, labels == Label.STATIC], [MOVING, STATIC], UNKNOWN)
    return _body(wider, *cells.shape[:2])


def with_rows(message: Any, kept: npt.NDArray[np.bool_]) -> Body:
    """Return those points of `message` that are `kept` (N,), as one row."""
    rows = cells_of(message, "a message").reshape(-1, int(message.point_step))[kept]
    return _body(rows, 1, len(rows))


def new_field(message: Any, make: Any) -> Any:
    """Return the description of the field that `with_field` adds; `make` is the class of such."""
    return make(name=FIELD, offset=int(message.point_step), datatype=_UINT8, count=1)


def _body(rows: npt.NDArray[np.uint8], height: int, width: int) -> Body:
    data = array.array("B")  # which messages take as it is: of NumPy's arrays they check every byte
    data.frombytes(np.ascontiguousarray(rows).reshape(-1).data)
    return Body(int(height), int(width), rows.shape[1], int(width) * rows.shape[1], data)


class RosFeed(Feed):
    """Clouds of topic `points`, as scans; where labelling is slower than they come, the latest are kept.

    Attributes
    ----------
    node : the rclpy node, with the arguments and parameters of ROS.
    """

    is_compensated = None

    def __init__(self, arguments: Sequence[str]):
        """Make the node from what follows --ros-args on the command line.

        Raises
        ------
        MissingExtraError : there is no ROS 2.
        InputError : ROS refuses the arguments.
        """
        super().__init__()
        try:
            import rclpy
            from rclpy.signals import SignalHandlerOptions
        except ImportError:
            raise MissingExtraError(
                "rclpy is not there: source ROS 2 (source /opt/ros/DISTRO/setup.bash) and install automos for that "
                "very Python (python3 -m venv --system-site-packages ENV)"
            ) from None
        self._context = rclpy.Context()
        try:  # Ctrl-C is ours: what was pushed is still given back
            rclpy.init(
                args=["automos", *arguments], context=self._context, signal_handler_options=SignalHandlerOptions.NO
            )
            self.node = rclpy.create_node("automos", context=self._context)
        except Exception as error:  # of which rclpy has many
            raise InputError(f"ROS 2 does not take these arguments ({str(error).splitlines()[0]})") from None
        self.topic = self.node.resolve_topic_name(TOPIC)
        self.name = self.topic.strip("/")
        self._messages: OrderedDict[str, Any] = OrderedDict()
        self._subscription: Any = None
        self._is_reliable: bool | None = None
        self._number, self._heard, self._is_warned = 0, 0.0, False

    def receive(self) -> None:
        """Spin the node until `_stop` is set."""
        from rclpy.executors import SingleThreadedExecutor

        executor = SingleThreadedExecutor(context=self._context)
        executor.add_node(self.node)
        look = 0.0
        while not self._stop.is_set() and self._context.ok():
            if time.monotonic() >= look:
                self._look()
                look = time.monotonic() + LOOK
            executor.spin_once(timeout_sec=0.1)
        executor.shutdown()

    def message(self, name: str) -> Any:
        """Return the cloud that scan `name` was made of, and forget those before it."""
        while True:
            stored, message = self._messages.popitem(last=False)
            if stored == name:
                return message

    def summary(self) -> str:
        """Return a sentence on what arrived."""
        return f"{self._number} clouds arrived on {self.topic}"

    def close(self) -> None:
        """End the node."""
        self.stop()
        self.node.destroy_node()
        self._context.try_shutdown()

    def _look(self) -> None:
        """Subscribe as the publishers of now offer, and warn if there are some of which nothing comes."""
        from rclpy.qos import QoSProfile, ReliabilityPolicy

        publishers = self.node.get_publishers_info_by_topic(self.topic)
        now = time.monotonic()
        if not publishers:
            return
        is_reliable = all(p.qos_profile.reliability == ReliabilityPolicy.RELIABLE for p in publishers)
        if is_reliable != self._is_reliable:
            if self._subscription is not None:
                self.node.destroy_subscription(self._subscription)
            from sensor_msgs.msg import PointCloud2

            policy = ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT
            quality = QoSProfile(depth=ROOM, reliability=policy)
            self._subscription = self.node.create_subscription(PointCloud2, self.topic, self._take, quality)
            self._is_reliable, self._heard, self._is_warned = is_reliable, now, False
        elif now - self._heard > SILENCE and not self._is_warned:
            how = "reliable" if is_reliable else "best effort"
            _log.warning(
                "%s has %d publishers (%s), but no cloud came for %.0f s: if they do publish, clouds may be too large "
                "for the transport; raise net.core.rmem_max, or let them be reliable",
                *(self.topic, len(publishers), how, now - self._heard),
            )
            self._is_warned = True

    def _take(self, message: Any) -> None:
        name = f"{self._number:06d}"
        self._number, self._heard, self._is_warned = self._number + 1, time.monotonic(), False
        try:
            scan = scan_of(message, name)
        except InputError as error:
            _log.warning("%s: a cloud is left out (%s)", self.topic, error)
            return
        self._messages[name] = message
        self.latest.put(scan)
