import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from automos.readers.records import parse_table

numbers = st.floats(-1e100, 1e100) | st.sampled_from([np.nan, np.inf, -np.inf])


@settings(max_examples=200, deadline=None)
@given(st.lists(st.lists(numbers, min_size=3, max_size=3), min_size=1, max_size=20))
def test_numbers_come_back_to_the_fifteenth_digit(rows):
    text = "\n".join(" ".join(map(repr, row)) for row in rows).encode()
    np.testing.assert_allclose(parse_table(text), rows, rtol=1e-15, atol=1e-290)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.floats(width=32, min_value=-1e6, max_value=1e6), min_size=1, max_size=20))
def test_float32_numbers_in_nine_digits_come_back_exactly(values):
    text = " ".join(f"{value:.9g}" for value in values).encode()
    np.testing.assert_array_equal(parse_table(text)[0].astype(np.float32), np.array(values, np.float32))


@pytest.mark.parametrize(
    "word",
    [
        *("0", "-0", "+7", ".5", "5.", "-.5e1", "1e5", "1E-3", "1e+05", "nan", "-NaN", "inf", "+Infinity", "-INF"),
        *("1e400", "1e-400", "0e999", "123456789012345678901234", "0.000000000000000000000001234"),
    ],
)
def test_numbers_are_those_of_python(word):
    np.testing.assert_allclose(parse_table(word.encode()), [[float(word)]], rtol=1e-15)


def test_blank_lines_are_no_rows_and_line_ends_may_be_of_any_system():
    np.testing.assert_array_equal(parse_table(b"\n 1\t2 \r\n\r\n\n3 4"), [[1, 2], [3, 4]])
    assert parse_table(b"").shape == parse_table(b" \n\n").shape == (0, 0)


def test_rows_are_skipped_and_limited_whatever_the_others_hold():
    text = b"a header\n\n1 2\n3 4\n3 0 1 2\n"
    np.testing.assert_array_equal(parse_table(text, n_skipped=1, n_rows=2), [[1, 2], [3, 4]])
    np.testing.assert_array_equal(parse_table(text, n_skipped=2, n_rows=1), [[3, 4]])
    for promised in (2**63, 2**64, 10**30):  # headers of PCD and PLY files count as far as they like
        assert len(parse_table(b"1 2\n3 4\n", n_rows=promised)) == 2
        assert len(parse_table(b"1 2\n3 4\n", n_skipped=promised)) == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"1 2 3\n4 5\n6 7 8 9\n", "columns changed from 3 to 2 at row 2"),
        (b"1 2\n\n3 4\n5", "columns changed from 2 to 1 at row 3"),
        (b"1 2\n3 x\n", "string 'x' to float64 at row 1, column 2"),
        (b"1 2\n3 4\n" + 4096 * b"\0", "columns changed from 2 to 1|could not convert"),
        (b"1 2\n3\x004\n", "columns changed from 2 to 1|could not convert"),
        (b"1 2\n3\x1b 4\n", r"string '3.x1b' to float64 at row 1"),
        (b"1 2\n3 4q\n", "string '4q' to float64 at row 1, column 2"),
        *((word, f"string '{word.decode()}'") for word in (b"-", b".", b"1e", b"1e+", b"e5", b"--1", b"1.2.3")),
        *((word, f"string '{word.decode()}'") for word in (b"in", b"nana", b"0x10", b"1_0", b"-+1")),
    ],
)
def test_what_is_no_table_is_told_with_its_line(text, message):
    with pytest.raises(ValueError, match=message.replace("+", r"\+")):
        parse_table(text)
