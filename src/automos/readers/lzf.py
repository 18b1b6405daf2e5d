"""Decompression of LZF, the byte format inside binary_compressed PCD files.

A control byte below 32 starts a run of that many plus one literal bytes. Any other is a copy from what was already
written: its upper three bits are the length less two (seven: one more byte adds to it), its lower five and the next
byte the distance back less one.
"""

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel

Bytes = npt.NDArray[np.uint8]


def decompress(packed: Bytes, n_bytes: int) -> Bytes:
    """Return the (n_bytes,) uint8 that `packed` (K,) uint8 stands for.

    Raises
    ------
    ValueError
        If `packed` is damaged or stands for another number of bytes.
    """
    out = np.empty(n_bytes, np.uint8)
    written = _decompress(packed, out)
    if written != n_bytes:
        raise ValueError(f"LZF data is damaged: it does not unpack to {n_bytes} bytes")
    return out


@kernel
def _decompress(packed, out):  # type: ignore[no-untyped-def]
    """Fill `out` and return the number of bytes written, -1 where reading or writing would leave an array."""
    i, o = 0, 0
    n_in, n_out = len(packed), len(out)
    while i < n_in:
        control = np.int64(packed[i])
        i += 1
        if control < 32:
            length = control + 1
            if i + length > n_in or o + length > n_out:
                return -1
            for k in range(length):
                out[o + k] = packed[i + k]
            i += length
            o += length
            continue
        behind = 2 if control >= 224 else 1
        if i + behind > n_in:
            return -1
        length = (control >> 5) + 2 + (np.int64(packed[i]) if behind == 2 else 0)
        i += behind
        source = o - ((control & 31) << 8) - np.int64(packed[i - 1]) - 1
        if source < 0 or o + length > n_out:
            return -1
        for k in range(length):  # byte by byte: the copy may overlap what it writes
            out[o + k] = out[source + k]
        o += length
    return o
