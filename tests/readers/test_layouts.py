"""Columns as a user says them."""

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.readers.codecs import parse_columns, spell_columns


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("x,y,z", 12),
        ("bin6", 24),
        ("x:f8,y,z", 24),
        ("x,y,z,ring:u2,_:V2", 16),
        (" x , y,z , t:>u4", 16),
        ("t:f8,x,y,z", 20),
    ],
)
def test_a_point_has_the_bytes_of_its_columns(text, size):
    dtype = parse_columns(text)
    assert dtype.itemsize == size
    assert parse_columns(spell_columns(dtype)) == dtype


def test_columns_without_a_type_have_that_of_x():
    dtype = parse_columns("t:u4,x:f8,y,z,ring:u1,_")
    assert [dtype[name].str for name in dtype.names] == ["<u4", "<f8", "<f8", "<f8", "|u1", "<f8"]


@pytest.mark.parametrize(
    "text",
    ["x,y", "x,y,z,x", "x,y,z:f3", "x,y,z,", "x,y,z,_:V99999", ",".join(["x,y,z", *(f"a{i}" for i in range(200))])],
)
def test_what_names_no_points_is_told(text):
    with pytest.raises(InputError, match="--columns"):
        parse_columns(text)


def test_padding_is_left_out_whatever_it_holds(tmp_path):
    from automos.readers.codecs import read_columns

    rows = np.zeros(3, [("x", "f4"), ("y", "f4"), ("z", "f4"), ("p", "V4"), ("ring", "u2")])
    rows["ring"] = [1, 2, 3]
    rows.tofile(tmp_path / "a.bin")
    assert read_columns(tmp_path / "a.bin", "bin", "x,y,z,_:V4,ring:u2").keys() == {"x", "y", "z", "ring"}
