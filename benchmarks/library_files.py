"""Readers and writers of ours beside libraries': milliseconds for 120,000 points, and what becomes of damaged files.

Called by `libraries.py`. A damaged file is a copy cut short, with one byte of its header changed, with a count beyond
all memory, or with more bytes than it promises; both read the same 402 copies.
"""

from __future__ import annotations

import struct
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.readers import npy, pcd, ply
from automos.readers.columns import coordinates
from automos.writers.pcd import write_pcd

N = 120_000
_RNG = np.random.default_rng(0)
POINTS = _RNG.uniform([-60, -60, -2], [60, 60, 4], (N, 3)).astype(np.float32)
COLUMNS = {**dict(zip("xyz", POINTS.T, strict=True)), "intensity": POINTS[:, 0], "ring": np.arange(N, dtype="u2") % 64}
ROWS = np.rec.fromarrays([*COLUMNS.values()], names=[*COLUMNS])


def best_ms(call: Callable[[], object], repeat: int = 5) -> float:
    """Return the milliseconds of the fastest of `repeat` calls, after one that compiles and warms caches."""
    call()
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - start))
    return round(min(times), 2)


def files() -> dict[str, dict[str, float]]:
    """Return time and outcomes for every reader that is installed."""
    with tempfile.TemporaryDirectory() as folder:
        whole = _write_all(Path(folder))
        out = {}
        for suffix, name, read in _readers():
            found = {"ms": best_ms(lambda read=read, path=whole[suffix]: read(path))}
            bad = Path(folder) / f"bad{suffix}"
            counts: Counter[str] = Counter()
            for raw in _damaged(whole[suffix].read_bytes()):
                bad.write_bytes(raw)
                with np.errstate(all="ignore"):
                    counts[_outcome(read, bad)] += 1
            out[f"{suffix}, {name}"] = found | dict(sorted(counts.items()))
    return out


def _readers() -> Iterator[tuple[str, str, Callable]]:
    yield ".npy", "ours on numpy.load", _checked(npy.read)
    yield ".npy", "numpy.load alone", lambda path: np.load(path, allow_pickle=False)
    yield ".pcd", "ours", _checked(pcd.read)
    yield ".ply", "ours", _checked(ply.read)
    try:
        from pypcd4 import PointCloud

        yield ".pcd", "pypcd4", lambda path: PointCloud.from_path(path).pc_data
    except ImportError as error:
        print(error)
    try:
        from plyfile import PlyData

        yield ".ply", "plyfile", lambda path: PlyData.read(path)["vertex"].data
    except ImportError as error:
        print(error)


def _checked(read: Callable) -> Callable:
    """Return a reader of ours with the check for x, y and z that every scan passes."""

    def checked(path: Path) -> dict:
        columns = read(path)
        coordinates(columns, path)
        return columns

    return checked


def _write_all(folder: Path) -> dict[str, Path]:
    paths = {suffix: folder / f"scan{suffix}" for suffix in (".npy", ".pcd", ".ply")}
    np.save(paths[".npy"], ROWS)
    write_pcd(paths[".pcd"], COLUMNS)
    kinds = "".join(f"property {'ushort' if name == 'ring' else 'float'} {name}\n" for name in COLUMNS)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {N}\n{kinds}end_header\n"
    paths[".ply"].write_bytes(head.encode() + ROWS.tobytes())
    return paths


def _damaged(raw: bytes, n: int = 200) -> Iterator[bytes]:
    rng = np.random.default_rng(1)
    for _ in range(n):
        yield raw[: rng.integers(0, len(raw))]
        at = rng.integers(0, 150)
        yield raw[:at] + bytes([rng.integers(0, 256)]) + raw[at + 1 :]
    yield raw.replace(str(N).encode(), b"999999999999")
    yield raw + raw[-17_000:]


def _outcome(read: Callable, path: Path) -> str:
    try:
        found = read(path)
        is_whole = all(np.array_equal(found[axis], ROWS[axis]) for axis in "xyz")
    except Exception as error:
        if isinstance(error, InputError):
            return "error that names the file"
        is_own = isinstance(error, ValueError) or type(error).__module__.partition(".")[0] in ("plyfile", "pypcd4")
        return "its own error or ValueError" if is_own else f"{type(error).__name__} from within"
    return "points, right" if is_whole else "points, wrong"


def images() -> dict[str, dict[str, float]]:
    """Return time and bytes of a picture of a million pixels in eight colours, as the report's map is made of."""
    from automos.views.png import palette_png

    height, width, colors = 1000, 1000, _RNG.integers(0, 256, (8, 4), np.uint8)
    picture = (_RNG.random((height, width)) ** 4 * 8).astype(np.uint8)

    def by_hand() -> bytes:
        head = struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)
        rows = zlib.compress(np.pad(picture, ((0, 0), (1, 0))).tobytes(), 9)
        chunks = {b"IHDR": head, b"PLTE": colors[:, :3].tobytes(), b"tRNS": colors[:, 3].tobytes(), b"IDAT": rows}
        out = b"\x89PNG\r\n\x1a\n"
        for kind, content in (chunks | {b"IEND": b""}).items():
            out += struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        return out

    both = {"numpy and zlib": by_hand, "Pillow (ours)": lambda: palette_png(picture, colors)}
    return {name: {"ms": best_ms(write), "bytes": len(write())} for name, write in both.items()}
