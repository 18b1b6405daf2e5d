"""Damage by structure: the numbers, words, fields, counts and offsets of a file, its end, its name and its kind."""

import json
import os
import random
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from damage_tables import WHOLE, change_array, change_column, change_rows, write_noise

NUMBERS = (
    "0", "-1", "1", "nan", "inf", "-inf", "1e30", "-1e30", "1e-300", "9.3e18", "1e400", "4294967296",
    "18446744073709551616", "9223372036854775808", "2147483648", "-2147483649", "1e6", "abc", "", "٣", "1,5", "0x10",
    "9" * 5000,
)  # fmt: skip
"""What may stand where a number should."""
VALUES: tuple[Any, ...] = (None, True, 0, -1, 2**70, 1e308, "", "x", "\x1b[31m", [], {}, [[]], {"a": {}}, float("nan"))

_LAS_FIELDS = (
    (24, "<B"), (25, "<B"), (94, "<H"), (96, "<I"), (100, "<I"), (104, "<B"), (105, "<H"), (107, "<I"), (131, "<d"),
    (155, "<d"), (235, "<Q"), (243, "<I"), (247, "<Q"),
)  # fmt: skip
"""Where in a header are its version, sizes, offsets, counts and scales."""
_IS_TEXT = {".txt", ".csv", ".xyz", ".yaml", ".xml", ".json", ".jsonl", ".tum", ".gps"}


def damage(folder: Path, rng: random.Random, only: Path | None = None) -> str:
    """Damage one of the files below `folder`, or `only` that, in one way; return what was done."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    if not files:
        return "nothing is left to damage"
    path = only if only in files else rng.choice(files)
    text_like = path.suffix in _IS_TEXT
    ways: list[Callable[[Path, random.Random], str]] = [_content] * 6 if text_like else [write_noise] * 4 + [_count] * 3
    ways += [change_array] * (8 if path.suffix == ".npy" else 0)
    ways += [change_column] * (10 if path.suffix in (".parquet", ".feather") else 0)
    ways += [change_rows] * (10 if path.suffix in (".db3", ".sqlite") else 0)
    ways += [_header] * (4 if path.suffix in (".pcd", ".ply", ".npy") else 0)
    ways += [_las_field] * (6 if path.suffix == ".las" else 0)
    ways += [_json] * (8 if path.suffix == ".json" else 0)
    ways += [_end, _kind, _name]
    return f"{path.relative_to(folder)!s}: {rng.choice(ways)(path, rng)}"


def _content(path: Path, rng: random.Random) -> str:
    """Change a number, a line or a byte of a text."""
    text = path.read_bytes().decode("utf-8", "replace")
    way = rng.choice(("number", "line", "byte", "lines", "bom"))
    if way == "number":
        found = list(re.finditer(r"[-+]?\d+\.?\d*(e[-+]?\d+)?", text))
        at, new = rng.choice(found) if found else None, rng.choice(NUMBERS)
        text = text if at is None else text[: at.start()] + new + text[at.end() :]
    lines = text.split("\n")
    k = rng.randrange(len(lines))
    if way == "line":
        lines[k : k + 1] = rng.choice(([], [lines[k]] * 2, [lines[k] + " 7"], ["# x"], [lines[k][:3]]))
    content = "\n".join(lines).encode()
    if way == "byte":
        at = rng.randrange(len(content) + 1)
        content = content[:at] + bytes([rng.choice((0, 13, 27, 255, 128))]) + content[at:]
    if way == "lines":
        content = content.replace(b"\n", rng.choice((b"\r", b"\r\n", b"\x00", b"")))
    if way == "bom":
        content = "\ufeff".encode() + content if rng.random() < 0.5 else text.encode("utf-16")
    path.write_bytes(content)
    return f"{way}"


def _header(path: Path, rng: random.Random) -> str:
    """Change a word of a text header."""
    content = path.read_bytes()
    words = list(re.finditer(rb"[^\s,:'(){}]+", content[:400])) or [re.match(b"", content)]
    at, new = rng.choice(words), rng.choice((*NUMBERS, "x", "F", "float", "list", "|O", "<c16", "(3,)", "binary"))
    path.write_bytes(content[: at.start()] + new.encode() + content[at.end() :])
    return f"{at.group()!r} to {new[:30]!r}"


def _las_field(path: Path, rng: random.Random) -> str:
    content = bytearray(path.read_bytes()).ljust(375, b"\0")
    at, form = rng.choice(_LAS_FIELDS)
    value = rng.choice((*WHOLE, *range(8))) % (1 << 8 * struct.calcsize(form))
    struct.pack_into(form, content, at, float(value) if form == "<d" else value)
    path.write_bytes(content)
    return f"{form} {value} at {at}"


def _count(path: Path, rng: random.Random) -> str:
    """Change a whole number that could count something: it is no larger than the file."""
    content = bytearray(path.read_bytes())
    if len(content) < 4:
        return write_noise(path, rng)
    near = np.lib.stride_tricks.sliding_window_view(np.frombuffer(content[:20_000], np.uint8), 4).astype(np.uint32)
    found = [near @ (1 << np.arange(0, 32, 8, dtype=np.uint32)[::way]) for way in (1, -1)]
    form, values = rng.choice(list(zip(("<I", ">I"), found, strict=True))) if len(near) else ("<I", np.zeros(0))
    places = np.flatnonzero((values > 2) & (values <= len(content)))
    if not len(places):
        return write_noise(path, rng)
    at = int(rng.choice(places.tolist()))
    was = int(values[at])
    value = rng.choice((*WHOLE, was - 1, was + 1, 2 * was, was // 2)) % (1 << 32)
    struct.pack_into(form, content, at, value)
    path.write_bytes(content)
    return f"count {was} at {at} to {value}"


def _json(path: Path, rng: random.Random) -> str:
    """Change, remove or nest one value of a JSON document."""
    try:
        document = json.loads(path.read_text())
    except (ValueError, RecursionError):  # damaged before
        return "as it was"
    path.write_text(json.dumps(change(document, rng)) if rng.random() < 0.95 else "[" * 100_000)
    return "value"


def change(document: Any, rng: random.Random) -> Any:
    """Return a document with one value changed or removed."""
    if isinstance(document, dict) and document and rng.random() < 0.9:
        key = rng.choice(sorted(document))
        changed = {**document, key: change(document[key], rng)}
        if rng.random() < 0.15:
            del changed[key]
        return changed
    if isinstance(document, list) and document and rng.random() < 0.9:
        k = rng.randrange(len(document))
        return [*document[:k], change(document[k], rng), *document[k + 1 :]]
    return rng.choice(VALUES)


def _end(path: Path, rng: random.Random) -> str:
    content = path.read_bytes()
    way = rng.choice(("cut", "empty", "more", "cut a record"))
    n = {"cut": rng.randrange(len(content) + 1), "empty": 0, "more": len(content)}.get(way, max(len(content) - 16, 0))
    path.write_bytes(content[:n] + (rng.randbytes(rng.choice((1, 16, 1000))) if way == "more" else b""))
    return way


def _kind(path: Path, rng: random.Random) -> str:
    """Put something else than a file in its place."""
    way = rng.choice(("absent", "pipe", "folder", "link to itself", "link to nothing", "device"))
    path.unlink()
    if way == "pipe":
        os.mkfifo(path)
    elif way == "folder":
        path.mkdir()
    elif way != "absent":
        path.symlink_to({"link to itself": path.name, "link to nothing": "nothing", "device": "/dev/zero"}[way])
    return way


def _name(path: Path, rng: random.Random) -> str:
    new = rng.choice(("a" * 240, "\x1b[31mred", "x\ny", "..b", "٣", "name\udcff", path.stem.upper() + "x"))
    target = path.with_name(new + path.suffix)
    if rng.random() < 0.5:
        path.rename(target)
        return f"named {new[:20]!r}"
    target = path.with_suffix(path.suffix.upper())
    target.write_bytes(path.read_bytes())
    return "twin"
