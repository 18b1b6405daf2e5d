"""Files that no reader takes, known by their first bytes or their names: what they are, and what to do with them."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from automos.readers.formats import CAPTURES


def _packed(kind: str, how: str) -> tuple[str, str]:
    """Return what a compressed file is, and what to do with it."""
    return f"compressed ({kind}), so its scans cannot be read one by one", f"unpack it ({how}) and give what comes out"


def _other(kind: str, how: str) -> tuple[str, str]:
    """Return what a file of another kind is, and what to do with it."""
    return f"{kind}, which is not read as it is", how


_PACKED = {
    b"\x1f\x8b": _packed("gzip", "gunzip -k {}"),
    b"\x28\xb5\x2f\xfd": _packed("zstd", "zstd -d {}"),
    b"\x04\x22\x4d\x18": _packed("lz4", "lz4 -d {}"),
    b"BZh": _packed("bzip2", "bunzip2 -k {}"),
    b"\xfd7zXZ\0": _packed("xz", "unxz -k {}"),
    b"7z\xbc\xaf\x27\x1c": _packed("7z", "7z x {}"),
    b"Rar!": _packed("rar", "unrar x {}"),
}
_CAPTURE = _other("a capture of packets by its content", "rename it to {}.pcap")
_LIVOX = _other("a recording of Livox's viewer", "convert it to a ROS bag with Livox's lvx2rosbag and give that")
_OTHERS = {
    b"\x89MCAP0": _other("an MCAP file by its content", "rename it to {}.mcap"),
    b"#ROSBAG V2": _other("a ROS bag by its content", "rename it to {}.bag"),
    b"livox_tech": _LIVOX,
    **dict.fromkeys((b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\n\r\r\n"), _CAPTURE),
}
_SCANS = "export its scans, one file each and in the scanner's frame, into a folder and give that"
_NAMED = {
    ".e57": _other("a single E57 file", _SCANS),
    ".lvx3": _LIVOX,
    ".tar": _other("an archive (tar)", "unpack it (tar -xf {}) and give what comes out"),
    ".rrf": _other("a recording of Cepton's viewer", "export its frames as PCD into a folder and give that"),
    ".tfrecord": _other("a file of Waymo's version 1", "download version 2 (Parquet), which holds the same drives"),
}


def what_to_do(path: Path) -> str | None:
    """Return what the file at `path` is and what to do with it, in a sentence; None where nothing is known of it."""
    start = b""
    with suppress(OSError):
        if path.is_file():
            with open(path, "rb") as file:
                start = file.read(16)
    suffix = path.suffix.lower()
    by_content = _PACKED if suffix in CAPTURES else _PACKED | _OTHERS
    known = next((told for magic, told in by_content.items() if start.startswith(magic)), _NAMED.get(suffix))
    return None if known is None else f"{path} is {known[0]}; {known[1].format(path.name)}"


def first_known(paths: Iterable[Path]) -> str | None:
    """Return what to do with the first of some files of which something is known."""
    return next(filter(None, map(what_to_do, paths)), None)
