"""Files that no reader takes, known by their first bytes or their names: what they are, and what to do with them."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from automos.readers.formats import CAPTURES

_PACKED = {
    b"\x1f\x8b": ("gzip", "gunzip -k {}"),
    b"\x28\xb5\x2f\xfd": ("zstd", "zstd -d {}"),
    b"\x04\x22\x4d\x18": ("lz4", "lz4 -d {}"),
    b"BZh": ("bzip2", "bunzip2 -k {}"),
    b"\xfd7zXZ\0": ("xz", "unxz -k {}"),
    b"7z\xbc\xaf\x27\x1c": ("7z", "7z x {}"),
    b"Rar!": ("rar", "unrar x {}"),
}
_OTHERS = {
    b"\x89MCAP0": ("an MCAP file by its content", "rename it to {}.mcap"),
    b"#ROSBAG V2": ("a ROS bag by its content", "rename it to {}.bag"),
    b"livox_tech": ("a recording of Livox's viewer", "convert it to a ROS bag with Livox's lvx2rosbag and give that"),
    **dict.fromkeys(
        (b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\n\r\r\n"),
        ("a capture of packets by its content", "rename it to {}.pcap"),
    ),
}
_NAMED = {
    ".e57": (
        "a single E57 file",
        "export its scans, one file each and in the scanner's frame, into a folder and give that",
    ),
    ".lvx3": _OTHERS[b"livox_tech"],
    ".tar": ("an archive (tar)", "unpack it (tar -xf {}) and give what comes out"),
    ".rrf": ("a recording of Cepton's viewer", "export its frames as PCD into a folder and give that"),
    ".tfrecord": ("a file of Waymo's version 1", "download version 2 (Parquet), which holds the same drives"),
}


def what_to_do(path: Path) -> str | None:
    """Return what the file at `path` is and what to do with it, in a sentence; None where nothing is known of it."""
    start = b""
    with suppress(OSError):
        if path.is_file():
            with open(path, "rb") as file:
                start = file.read(16)
    packed = next((how for magic, how in _PACKED.items() if start.startswith(magic)), None)
    if packed is not None:
        kind, command = packed
        return (
            f"{path} is compressed ({kind}), so its scans cannot be read one by one; unpack it "
            f"({command.format(path.name)}) and give what comes out"
        )
    is_named = path.suffix.lower() in CAPTURES
    known = next((what for magic, what in _OTHERS.items() if start.startswith(magic) and not is_named), None)
    known = known or _NAMED.get(path.suffix.lower())
    return None if known is None else f"{path} is {known[0]}, which is not read as it is; {known[1].format(path.name)}"


def first_known(paths: Iterable[Path]) -> str | None:
    """Return what to do with the first of some files of which something is known."""
    return next(filter(None, map(what_to_do, paths)), None)
