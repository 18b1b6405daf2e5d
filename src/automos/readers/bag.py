"""A bag: one file, ROS 2's folder of them, or the parts of one drive that its recorder split.

What the files hold says what belongs together: `drive_0.bag+` is that file and those beside it that go on where it
ends, with the same topics.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from automos.core.arrays import Ints
from automos.core.errors import AutomosError, InputError
from automos.core.reading import damage_reported, is_there, parse_yaml, read_text, require_regular
from automos.readers.bag_chunks import ZSTD, unpack
from automos.readers.bag_kinds import KINDS, BagFile
from automos.readers.bag_messages import LARGEST, Topic, is_of_points
from automos.readers.foreign import limited

_SUFFIXES = (".bag", ".bag.active", ".mcap", ".db3")
_PAUSE = 1.0
"""Seconds from the last cloud of a part to the first of the next: a recorder that was started anew takes longer."""


def is_named_so(path: Path) -> bool:
    """Return whether a file has the name of a bag."""
    return path.name.lower().endswith(_SUFFIXES)


def is_bag(path: Path) -> bool:
    """Return whether `path` is a bag: a file of one of its kinds, such a file and what goes on from it, or a folder."""
    if path.name.endswith("+"):
        return is_bag(path.with_name(path.name[:-1]))
    if path.is_dir():
        return (path / "metadata.yaml").exists() and any(is_named_so(p) or is_packed(p) for p in path.iterdir())
    return is_named_so(path) and path.is_file()


def is_packed(file: Path) -> bool:
    """Return whether `file` is one of a bag, compressed as a whole."""
    return file.suffix == ".zstd" and is_named_so(Path(file.stem))


def name_of(bag: Path) -> str:
    """Return what a recording in a bag is called: its first file, or its folder, without what tells the kind."""
    name = bag.resolve().name.removesuffix("+")
    suffix = next((suffix for suffix in _SUFFIXES if name.lower().endswith(suffix)), "")
    return name[: len(name) - len(suffix)]


def split_address(path: Path) -> tuple[Path, str | None]:
    """Return the bag at or above `path`, and the topic that is named below it."""
    bag = next(parent for parent in (path, *path.parents) if is_bag(parent))
    return bag, None if bag == path else path.relative_to(bag).as_posix()


def files_of(bag: Path) -> list[Path]:
    """Return what a bag is made of.

    Raises
    ------
    InputError
        Files that are compressed as a whole: the clouds in them cannot be read one by one.
    """
    if bag.name.endswith("+"):
        first = bag.with_name(bag.name[:-1])
        return [file for part in next(d for d in drives_of(first.parent) if first in d) for file in files_of(part)]
    if not bag.is_dir():
        return [bag]
    files = sorted(file for file in bag.iterdir() if not file.is_dir())
    packed = next(filter(is_packed, files), None)
    if packed is not None:
        raise InputError(
            f"{packed} is compressed as a whole, so its messages cannot be read one by one; unpack it (zstd -d "
            f"{packed.name}) and give the unpacked file"
        )
    return [file for file in files if is_named_so(file)]


def drives_of(folder: Path) -> list[list[Path]]:
    """Return the bags in `folder`, files and ROS 2's folders, those of a drive together, in the order of time."""
    files = sorted(p for p in folder.iterdir() if not p.name.startswith(".") and is_bag(p))
    if len(files) < 2:
        return [[file] for file in files]
    told = {file: _topics_and_times(file) for file in files}
    drives: list[list[Path]] = []
    by_start = sorted((file for file in files if told[file]), key=lambda file: told[file][1:])
    for file in by_start:
        topics, start, _ = told[file]
        going_on = (d for d in drives if told[d[-1]][0] == topics and 0 <= start - told[d[-1]][2] <= 1e9 * _PAUSE)
        drive = next(going_on, None)
        drives.append([file]) if drive is None else drive.append(file)
    return sorted([*drives, *([file] for file in files if not told[file])])


def _topics_and_times(file: Path) -> tuple:
    """Return a file's topics of points, and when the first and the last of their messages were recorded (ns).

    Nothing where there are none, or where the file cannot be read, which is told when it is opened.
    """
    try:
        bag = Bag(file)
        topics = tuple(topic for topic in bag.topics if is_of_points(topic))
        recorded = bag.index(*topics)[:, 0]
    except (AutomosError, sqlite3.Error):
        return ()
    return (topics, int(recorded[0]), int(recorded[-1])) if len(recorded) else ()


def _open_file(path: Path) -> BagFile:
    with damage_reported(path):
        require_regular(path)
        with open(path, "rb") as file:
            start = file.read(16)
        if not start:
            raise InputError(f"{path} is empty: nothing was recorded, or copied; record or copy it again")
        kind = next((kind for magic, kind in KINDS.items() if start.startswith(magic)), None)
        if kind is None:
            known = ", ".join(str(magic)[1:] for magic in KINDS)
            raise InputError(
                f"{path} is not a bag: it begins with {str(start)[1:]}, bags with {known}; check what it is"
            )
        return kind(path)


class Bag:
    """The messages of all files of a bag, in the order of time."""

    def __init__(self, path: Path):
        """Find them; errors are those of `files_of`, and InputError where a file is damaged or of another kind."""
        self.path, self.paths = path, files_of(path)
        self.files = [_open_file(file) for file in self.paths]

    @property
    def topics(self) -> list[Topic]:
        """The topics of any file, by name."""
        return sorted({topic for file in self.files for topic in file.topics.values()})

    def index(self, *topics: Topic) -> Ints:
        """Return (N, 4) of each message of some topics when it was recorded (ns), its file, its chunk and its place."""
        rows = (
            np.insert(file.places(number), 1, k, axis=1)
            for k, file in enumerate(self.files)
            for number, topic in file.topics.items()
            if topic in topics
        )
        every = np.concatenate([np.zeros((0, 4), np.int64), *rows])
        _, first = np.unique(every[:, 1:], axis=0, return_index=True)  # an index may list a message twice
        every = every[np.sort(first)]
        return every[np.argsort(every[:, 0], kind="stable")]

    def read(self, row: Ints, most: int = LARGEST) -> bytes:
        """Return the first `most` bytes, or all, of the message in a row of the index."""
        _, file, chunk, place = row.tolist()
        with damage_reported(self.paths[file]):
            raw = self.files[file].read(chunk, place, most)
            if raw.startswith(ZSTD):  # its recorder compressed each message
                raw = unpack(self.files[file].read(chunk, place), "zstd", most)
            return raw

    def size(self, row: Ints) -> int:
        """Return the bytes of the message in a row of the index, as it lies in its file."""
        _, file, chunk, place = row.tolist()
        with damage_reported(self.paths[file]):
            return self.files[file].size_of(chunk, place)

    def keep(self, *topics: Topic) -> None:
        """Forget the messages of all other topics."""
        for file in self.files:
            file.keep({number for number, topic in file.topics.items() if topic in topics})

    def counted(self, topic: Topic) -> int:
        """Return how many messages of a topic the bag's own metadata count, 0 where it has none."""
        about = self.path / "metadata.yaml"
        if not is_there(about):
            return 0
        try:
            entries = parse_yaml(read_text(about))["rosbag2_bagfile_information"]["topics_with_message_count"]
            return sum(e["message_count"] for e in entries if e["topic_metadata"]["name"] == topic.name)
        except (OSError, ValueError, LookupError, TypeError):  # nothing else depends on it
            return 0


@contextmanager
def reported(bag: Path) -> Iterator[None]:
    """Turn whatever a reader of bags stumbles over into one sentence: damaged files break it in many ways."""
    tools = "'rosbag reindex', 'ros2 bag reindex' or 'mcap recover'"
    remedy = f"it may be cut short: copy it again, or repair it with {tools}"
    with damage_reported(bag, "cannot be read as a ROS bag", remedy, kinds=Exception), limited(bag):
        yield
