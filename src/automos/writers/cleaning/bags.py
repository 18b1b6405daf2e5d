"""Bags with some points of one topic left out: every other message, and every other byte, is copied."""

from __future__ import annotations

import shutil
import sqlite3
from collections import defaultdict, deque
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from automos.core.atomic import atomic_path
from automos.core.errors import InputError
from automos.readers.formats import import_extra
from automos.readers.rosbag_topic import RosbagSequence, bag_files

Cut = Callable[[int, bytes, str, bool], bytes]
"""Takes the number of a scan, its message, the message's type and whether it is ROS 2's; returns what to write."""


class _Messages:
    """The messages of the topic, each known by when it was recorded: which scan it is, and what becomes of it."""

    def __init__(self, sequence: RosbagSequence, cut: Cut):
        self.topic, self._cut, self.n_left = sequence.topic, cut, len(sequence)
        self._scans: dict[int, deque[int]] = defaultdict(deque)
        for index, recorded in enumerate(sequence.recorded.tolist()):
            self._scans[recorded].append(index)

    def __call__(self, raw: bytes, kind: str, recorded: int, is_ros2: bool) -> bytes:
        waiting = self._scans[recorded]
        if not waiting:
            raise InputError(f"topic {self.topic} has changed since the recording was labelled: label it again")
        self.n_left -= 1
        return self._cut(waiting.popleft(), raw, kind, is_ros2)


def rewrite_bag(sequence: RosbagSequence, out: Path, cut: Cut) -> Path:
    """Write the bag of `sequence` into folder `out`, each message of its topic as `cut` returns it.

    Returns
    -------
    Path
        The bag: a file of the same name, or of a ROS 2 bag that is a folder, such a folder.
    """
    source = sequence.source
    target = out / source.resolve().name
    target.parent.mkdir(parents=True, exist_ok=True)
    messages = _Messages(sequence, cut)
    for file in bag_files(source):
        place = target / file.name if source.is_dir() else target
        place.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(place) as temporary:
            _REWRITES.get(file.suffix, _copy)(file, temporary, messages)
    if messages.n_left:
        raise InputError(f"{source} holds {messages.n_left} scans fewer than were labelled: label it again")
    return target


def _copy(source: Path, target: Path, messages: _Messages) -> None:
    shutil.copyfile(source, target)


def _rewrite_bag1(source: Path, target: Path, messages: _Messages) -> None:
    """Write a ROS 1 bag."""
    bag1 = import_extra("rosbags.rosbag1", "ros")
    with bag1.Reader(source) as reader, bag1.Writer(target) as writer:
        of: dict[int, Any] = {}
        for connection in reader.connections:
            of[connection.id] = writer.add_connection(
                connection.topic,
                connection.msgtype,
                msgdef=connection.msgdef.data,
                md5sum=connection.digest,
                callerid=connection.ext.callerid,
                latching=connection.ext.latching,
            )
        for connection, recorded, raw in reader.messages():
            if connection.topic == messages.topic:
                raw = messages(raw, connection.msgtype, recorded, False)
            writer.write(of[connection.id], recorded, raw)


def _rewrite_sqlite(source: Path, target: Path, messages: _Messages) -> None:
    """Write a database of ROS 2: a copy in which the messages of the topic are replaced."""
    shutil.copyfile(source, target)
    with closing(sqlite3.connect(target)) as base, base:
        topics = base.execute("SELECT id, type FROM topics WHERE name = ?", [messages.topic]).fetchall()
        for topic, kind in topics:
            rows = base.execute("SELECT id, timestamp FROM messages WHERE topic_id = ? ORDER BY timestamp, id", [topic])
            for row, recorded in rows.fetchall():
                ((raw,),) = base.execute("SELECT data FROM messages WHERE id = ?", [row])
                base.execute("UPDATE messages SET data = ? WHERE id = ?", [messages(raw, kind, recorded, True), row])


def _rewrite_mcap(source: Path, target: Path, messages: _Messages) -> None:
    """Write an MCAP file: schemas, channels, messages, attachments and metadata one after the other."""
    stream, records = import_extra("mcap.stream_reader", "ros"), import_extra("mcap.records", "ros")
    mcap = import_extra("mcap.writer", "ros")
    schemas, channels, kinds = {0: 0}, {}, {0: ""}
    with source.open("rb") as read, target.open("wb") as written:
        writer = mcap.Writer(written, compression=mcap.CompressionType.ZSTD)
        for record in stream.StreamReader(read).records:
            if isinstance(record, records.Header):
                writer.start(record.profile, record.library)
            elif isinstance(record, records.Schema) and record.id not in schemas:
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                kinds[record.id] = record.name
            elif isinstance(record, records.Channel) and record.id not in channels:
                number = writer.register_channel(
                    record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                )
                channels[record.id] = number, record
            elif isinstance(record, records.Message):
                number, channel = channels[record.channel_id]
                data = record.data
                if channel.topic == messages.topic:
                    data = messages(data, kinds[channel.schema_id], record.log_time, True)
                writer.add_message(number, record.log_time, data, record.publish_time, record.sequence)
            elif isinstance(record, records.Attachment):
                writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
            elif isinstance(record, records.Metadata):
                writer.add_metadata(record.name, record.metadata)
        writer.finish()


_REWRITES: dict[str, Callable[[Path, Path, _Messages], None]] = {
    ".bag": _rewrite_bag1,
    ".db3": _rewrite_sqlite,
    ".mcap": _rewrite_mcap,
}
