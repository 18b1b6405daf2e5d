"""Bags with some points of one topic left out: every other message, and every other byte, is copied.

A bag in several files is written as files of the same names. What a recorder left without an index is written with one.
"""

import importlib
import sqlite3
from collections import defaultdict
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.atomic import atomic_path
from automos.core.errors import AutomosError, InputError
from automos.core.extras import import_extra
from automos.readers.bag_chunks import IN_FILE, ZSTD
from automos.readers.bag_kinds import BagFile, McapFile, Ros1File, SqliteFile
from automos.readers.bag_messages import PACKETS, TYPES
from automos.readers.rosbag_topic import RosbagSequence
from automos.writers.formats import copy_file

Cut = Callable[[int, bytes], bytes]
"""Takes the number of a scan and its message; returns the message that is written in its place."""
_OTHERWISE = "give --as bin, pcd or laz"


class _Scans:
    """Those messages of one file of a bag that are scans, by their place, and what becomes of them."""

    def __init__(self, sequence: RosbagSequence, number: int, cut: Cut):
        self.file, self.topic, self._sequence, self._cut = sequence.bag.files[number], sequence.topic, sequence, cut
        self.at: dict[tuple[int, int], int] = {}
        self.recorded: dict[int, list[int]] = defaultdict(list)
        for index, (recorded, of, chunk, place) in enumerate(sequence.rows.tolist()):
            if of == number:
                self.at[chunk, place] = index
                self.recorded[recorded].append(index)
        self.left = set(self.at.values())

    def index_of(self, recorded: int, raw: bytes) -> int | None:
        """Return the scan, not written yet, of a message by when it was recorded and all that it holds."""
        for index in self.recorded[recorded]:
            _, _, chunk, place = self._sequence.rows[index].tolist()
            if index in self.left and self.file.read(chunk, place) == raw:
                return index
        return None

    def written(self, index: int | None, raw: bytes) -> bytes:
        """Return what is written for the message of scan `index`, which is `raw` in the file: compressed if that is."""
        if index not in self.left:
            raise self.changed()
        self.left.remove(index)
        cut = self._cut(index, self._sequence.bag.read(self._sequence.rows[index]))
        return bytes(importlib.import_module("zstandard").compress(cut)) if raw.startswith(ZSTD) else cut

    def changed(self) -> InputError:
        """Return what to say where the file holds other messages than the run has labels of."""
        return InputError(
            f"{self.file.path} does not hold just those messages of {self.topic.name} that were labelled: label it "
            f"again, or {_OTHERWISE}"
        )


def require_rewritable(sequence: RosbagSequence) -> None:
    """Raise InputError where the bag of `sequence`, or the messages of its topic, are not written again as such."""
    name, kind, encoding = sequence.topic
    if sequence.is_joined:
        raise InputError(f"{name} holds parts of a turn, which are not written again as such: {_OTHERWISE}")
    if kind in PACKETS:
        raise InputError(f"{name} holds a sensor's packets, of which no single points can be left out: {_OTHERWISE}")
    if kind not in TYPES or encoding not in ("cdr", "ros1"):
        raise InputError(f"{name} holds {kind} ({encoding}), which is not written again as such: {_OTHERWISE}")
    cut = next((file.path for file in sequence.bag.files if isinstance(file, McapFile) and file.fault), None)
    if cut is not None:
        raise InputError(
            f"{cut} has no end, and is not written again as such: {_OTHERWISE}, or label what 'mcap recover' makes"
        )


def rewrite_bag(sequence: RosbagSequence, out: Path, cut: Cut) -> Path:
    """Write the bag of `sequence` into folder `out`, each message of its topic as `cut` returns it.

    Returns
    -------
    Path
        The bag: a file of the same name, or of a ROS 2 bag that is a folder, such a folder.

    Raises
    ------
    InputError
        A file has changed, or cannot be written again.
    """
    source = sequence.source
    target = out / (source.resolve() if source.is_dir() else source).name
    folder = target if source.is_dir() else out
    folder.mkdir(parents=True, exist_ok=True)
    for number, file in enumerate(sequence.bag.files):
        scans = _Scans(sequence, number, cut)
        with atomic_path(folder / file.path.name) as temporary:
            try:
                _REWRITES[type(file)](scans, temporary)
            except (AutomosError, OSError):
                raise
            except Exception as error:  # damage breaks the libraries in many ways
                reason = " ".join(str(error).split()) or type(error).__name__
                raise InputError(f"{file.path} is not written again as such ({reason}): {_OTHERWISE}") from error
            if scans.left:
                raise scans.changed()
    for beside in source.iterdir() if source.is_dir() else ():
        # its metadata, and what else was put there; not the journals of its files, which are in the copies
        if beside.is_file() and not any(beside.name.startswith(path.name) for path in sequence.bag.paths):
            copy_file(beside, folder / beside.name)
    return target


def _rewrite_bag1(scans: _Scans, target: Path) -> None:
    """Write a ROS 1 bag: all messages that are whole, in the order in which they lie in the file."""
    bag1 = import_extra("rosbags.rosbag1", "ros")
    file = Ros1File(scans.file.path)  # that of the scans has forgotten the other topics
    rows = [np.insert(file.places(number), 0, number, axis=1) for number in file.topics]
    found = np.unique(np.concatenate(rows), axis=0)  # an index may list a message twice
    starts = np.where(found[:, 2] == IN_FILE, found[:, 3], found[:, 2])
    with bag1.Writer(target) as writer:
        made: dict[tuple, Any] = {}
        of: dict[int, Any] = {}
        for number, topic in file.topics.items():
            said = {name: value.decode() for name, value in file.connections[number].items()}
            options = {
                "msgdef": said[b"message_definition"],
                "md5sum": said[b"md5sum"],
                "callerid": said.get(b"callerid"),
                "latching": int(said[b"latching"]) if b"latching" in said else None,
            }
            key = topic, *options.values()
            if key not in made:  # a recorder that subscribed twice says the same of both
                made[key] = writer.add_connection(topic.name, topic.kind, **options)
            of[number] = made[key]
        for number, recorded, chunk, place in found[np.lexsort((found[:, 3], starts))].tolist():
            raw = file.read(chunk, place)
            if file.topics[number] == scans.topic:
                raw = scans.written(scans.at.get((chunk, place)), raw)
            writer.write(of[number], recorded, raw)


def _rewrite_sqlite(scans: _Scans, target: Path) -> None:
    """Write a database of ROS 2: a copy in which the messages of the topic are replaced."""
    assert isinstance(scans.file, SqliteFile)
    with closing(sqlite3.connect(target)) as base, base:
        scans.file.copy_to(base)
        base.execute("PRAGMA journal_mode = DELETE")  # whole without a journal beside it, whatever the recorder chose
        base.execute("PRAGMA trusted_schema = OFF")
        for (_, row), index in scans.at.items():
            ((raw,),) = base.execute("SELECT data FROM messages WHERE id = ?", [row])
            base.execute("UPDATE messages SET data = ? WHERE id = ?", [scans.written(index, raw), row])


def _rewrite_mcap(scans: _Scans, target: Path) -> None:
    """Write an MCAP file: schemas, channels, messages, attachments and metadata one after the other."""
    stream, records = import_extra("mcap.stream_reader", "ros"), import_extra("mcap.records", "ros")
    mcap = import_extra("mcap.writer", "ros")
    schemas, channels = {0: 0}, {}
    with scans.file.path.open("rb") as read, target.open("wb") as written:
        writer = mcap.Writer(written, compression=mcap.CompressionType.ZSTD)
        for record in stream.StreamReader(read).records:
            if isinstance(record, records.Header):
                writer.start(record.profile, record.library)
            elif isinstance(record, records.Schema) and record.id not in schemas:
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            elif isinstance(record, records.Channel) and record.id not in channels:
                channels[record.id] = writer.register_channel(
                    record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                )
            elif isinstance(record, records.Message):
                data = record.data
                if scans.file.topics[record.channel_id] == scans.topic:
                    data = scans.written(scans.index_of(record.log_time, data), data)
                writer.add_message(
                    channels[record.channel_id], record.log_time, data, record.publish_time, record.sequence
                )
            elif isinstance(record, records.Attachment):
                writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
            elif isinstance(record, records.Metadata):
                writer.add_metadata(record.name, record.metadata)
        writer.finish()


_REWRITES: dict[type[BagFile], Callable[[_Scans, Path], None]] = {
    Ros1File: _rewrite_bag1,
    SqliteFile: _rewrite_sqlite,
    McapFile: _rewrite_mcap,
}
