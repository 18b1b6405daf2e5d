import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from automos.readers.lzf import decompress

# Made by liblzf: 40 times "ab", 0..39, 600 zeros, "xyz".
REFERENCE = bytes.fromhex(
    "02616261e044011f000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f08202122232425262700"
    "e0ff00e0ff00e03e000278797a"
)
UNPACKED = b"ab" * 40 + bytes(range(40)) + bytes(600) + b"xyz"


def unpack(packed: bytes, n_bytes: int) -> bytes:
    return decompress(np.frombuffer(packed, np.uint8), n_bytes).tobytes()


def test_data_of_the_reference_implementation_is_unpacked():
    assert unpack(REFERENCE, len(UNPACKED)) == UNPACKED


def test_nothing_is_unpacked_to_nothing():
    assert unpack(b"", 0) == b""


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.binary(min_size=1, max_size=40), st.integers(1, 60)), max_size=20))
def test_what_was_packed_is_unpacked(pack_lzf, parts):
    raw = b"".join(part * times for part, times in parts)
    assert unpack(pack_lzf(raw), len(raw)) == raw


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=60), st.integers(0, 300))
def test_damaged_data_is_an_error_or_the_right_number_of_bytes(packed, n_bytes):
    try:
        unpacked = unpack(packed, n_bytes)
    except ValueError:
        return
    assert len(unpacked) == n_bytes


@pytest.mark.parametrize("cut", range(1, len(REFERENCE), 5))
def test_data_cut_short_is_damaged(cut):
    with pytest.raises(ValueError, match="damaged"):
        unpack(REFERENCE[:cut], len(UNPACKED))
