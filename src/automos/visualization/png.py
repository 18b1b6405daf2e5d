"""Pictures of few colours as PNG, small enough to live inside a page."""

from __future__ import annotations

import base64
import struct
import zlib

import numpy as np
import numpy.typing as npt


def palette_png(image: npt.NDArray[np.uint8], colors: npt.NDArray[np.uint8]) -> bytes:
    """Return a PNG file of `image` (H, W) uint8, rows from the top, whose values choose from `colors` (K, 4) RGBA.

    Written here because it is a few lines: the report needs nothing but numpy.
    """
    height, width = image.shape
    rows = np.zeros((height, width + 1), np.uint8)  # each row starts with its filter, 0: none
    rows[:, 1:] = image
    header = struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)
    return b"".join(
        [
            b"\x89PNG\r\n\x1a\n",
            _chunk(b"IHDR", header),
            _chunk(b"PLTE", np.ascontiguousarray(colors[:, :3]).tobytes()),
            _chunk(b"tRNS", np.ascontiguousarray(colors[:, 3]).tobytes()),
            _chunk(b"IDAT", zlib.compress(rows.tobytes(), 9)),
            _chunk(b"IEND", b""),
        ]
    )


def data_url(png: bytes) -> str:
    """Return `png` as the address of an image that lies in the page itself."""
    return "data:image/png;base64," + base64.b64encode(png).decode()


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
