"""Writers of point files, for tests only."""

import numpy as np

TYPES = {"f": "F", "i": "I", "u": "U"}
PLY_TYPES = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"}
PLY_TYPES |= {"f4": "float", "f8": "double"}


def table(columns: dict[str, np.ndarray], order: str = "<") -> np.ndarray:
    """Return the columns as one packed structured array."""
    dtype = [(name, column.dtype.newbyteorder(order)) for name, column in columns.items()]
    rows = np.zeros(len(next(iter(columns.values()))), dtype)
    for name, column in columns.items():
        rows[name] = column
    return rows


def text(rows: np.ndarray) -> bytes:
    lines = (" ".join(repr(value) for value in row.tolist()) for row in rows)
    return "".join(line + "\n" for line in lines).encode()


def pack_lzf(raw: bytes) -> bytes:
    """Compress as LZF, greedily: literals, and copies of what the last 8 kB hold."""
    out, literals, seen, i = bytearray(), bytearray(), {}, 0

    def flush():
        for start in range(0, len(literals), 32):
            run = literals[start : start + 32]
            out.extend([len(run) - 1, *run])
        literals.clear()

    while i < len(raw):
        key = raw[i : i + 3]
        at = seen.get(key, -1)
        seen[key] = i
        if len(key) < 3 or at < 0 or i - at > 8192:
            literals.append(raw[i])
            i += 1
            continue
        length = 3
        while length < 264 and i + length < len(raw) and raw[at + length] == raw[i + length]:
            length += 1
        flush()
        back = i - at - 1
        high = min(length - 2, 7) << 5 | back >> 8
        out.extend([high, length - 9, back & 255] if length >= 9 else [high, back & 255])
        i += length
    flush()
    return bytes(out)


def write_pcd(path, columns, encoding="binary", viewpoint="0 0 0 1 0 0 0"):
    rows = table(columns)
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {' '.join(columns)}\n"
        f"SIZE {' '.join(str(c.dtype.itemsize) for c in columns.values())}\n"
        f"TYPE {' '.join(TYPES[c.dtype.kind] for c in columns.values())}\n"
        f"COUNT {' '.join('1' for _ in columns)}\n"
        f"WIDTH {len(rows)}\nHEIGHT 1\nVIEWPOINT {viewpoint}\nPOINTS {len(rows)}\nDATA {encoding}\n"
    ).encode()
    if encoding == "ascii":
        body = text(rows)
    elif encoding == "binary":
        body = rows.tobytes()
    else:
        raw = b"".join(rows[name].tobytes() for name in columns)
        packed = pack_lzf(raw)
        body = np.array([len(packed), len(raw)], "<u4").tobytes() + packed
    path.write_bytes(header + body)


def write_ply(path, columns, encoding="binary_little_endian", before="", body_before=b""):
    rows = table(columns, ">" if encoding == "binary_big_endian" else "<")
    properties = "".join(f"property {PLY_TYPES[c.dtype.str[1:]]} {name}\n" for name, c in columns.items())
    header = f"ply\nformat {encoding} 1.0\ncomment a test\n{before}element vertex {len(rows)}\n{properties}end_header\n"
    path.write_bytes(header.encode() + body_before + (text(rows) if encoding == "ascii" else rows.tobytes()))


def write_points(path, columns, **options):
    """Write `columns` (name to (N,) array) to `path`, in the format of its suffix."""
    path.parent.mkdir(parents=True, exist_ok=True)
    match path.suffix:
        case ".pcd":
            write_pcd(path, columns, **options)
        case ".ply":
            write_ply(path, columns, **options)
        case ".npy":
            np.save(path, table(columns))
        case ".bin":
            np.column_stack(list(columns.values())).astype("<f4").tofile(path)
        case _:
            path.write_bytes(" ".join(columns).encode() + b"\n" + text(table(columns)))
