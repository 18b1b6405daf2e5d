"""The websocket for Foxglove and Lichtblick, read by a client that knows its protocol only."""

import json
import struct
import threading

import numpy as np
import pytest
from street_log import street_log

import automos

pytest.importorskip("foxglove", reason="pip install '.[foxglove]'")
client = pytest.importorskip("websockets.sync.client", reason="pip install websockets")


@pytest.fixture
def view():
    from automos.views.live import FoxgloveView

    made = FoxgloveView("street")
    yield made
    made.close()


def listen(url, count):
    """Return (topics, connection): all channels are subscribed to."""
    connection = client.connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None, legacy=True)
    channels = {}
    while len(channels) < count:
        message = connection.recv(timeout=10)
        told = json.loads(message) if isinstance(message, str) else {}
        if told.get("op") == "advertise":
            channels |= {each["id"]: each for each in told["channels"]}
    subscriptions = [{"id": k, "channelId": k} for k in channels]
    connection.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
    return channels, connection


def test_a_viewer_gets_points_boxes_transform_and_path(view):
    labeler = automos.Labeler(lag=0.0, threads=1)
    scans = street_log().scans
    given = [done for scan in scans for done in labeler.push(scan)]
    channels, connection = listen(view.url, 4)
    assert {each["topic"]: each["schemaName"] for each in channels.values()} == {
        "/points": "foxglove.PointCloud",
        "/objects": "foxglove.SceneUpdate",
        "/tf": "foxglove.FrameTransform",
        "/path": "foxglove.PosesInFrame",
    }
    threading.Event().wait(0.5)  # until it is subscribed
    view.show(scans[-1], given[-1])
    found = {}
    while len(found) < 4:
        message = connection.recv(timeout=10)
        if isinstance(message, bytes) and message[0] == 1:
            subscription, time = struct.unpack_from("<IQ", message, 1)
            found[channels[subscription]["topic"]] = message[13:]
            assert time == round(1e9 * given[-1].stamp)
    rows = np.zeros(
        len(scans[-1]), [*((n, "<f4") for n in ("x", "y", "z", "intensity")), ("label", "u1"), ("track", "<u4")]
    )
    for k, axis in enumerate("xyz"):
        rows[axis] = scans[-1].points[:, k]
    rows["intensity"], rows["label"], rows["track"] = scans[-1].intensity, given[-1].labels, given[-1].track_ids + 1
    assert rows[scans[-1].is_valid].tobytes() in found["/points"]
    assert (rows["label"] == 251).any()
    for thing in given[-1].objects:
        assert struct.pack("<d", thing["center"][0]) in found["/objects"]
    connection.close()
