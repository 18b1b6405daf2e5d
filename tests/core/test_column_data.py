from dataclasses import dataclass

import numpy as np

from automos.core.column_data import ColumnData


@dataclass(frozen=True, eq=False)
class Posts(ColumnData):
    number: np.ndarray
    place: np.ndarray


POSTS = Posts(np.array([4, 7, 9]), np.arange(6.0).reshape(3, 2))


def test_rows_are_picked_in_all_columns():
    some = POSTS[np.array([True, False, True])]
    assert len(some) == 2
    assert some.number.tolist() == [4, 9]
    assert some.place.tolist() == [[0.0, 1.0], [4.0, 5.0]]


def test_tables_are_joined_in_order():
    both = Posts.concatenate([POSTS[np.array([2])], POSTS])
    assert both.number.tolist() == [9, 4, 7, 9]
    assert both.place.shape == (4, 2)


def test_a_table_is_saved_and_read_beside_other_columns():
    again = Posts.from_arrays({**POSTS.to_arrays(), "other": np.zeros(1)})
    for name, column in POSTS.to_arrays().items():
        np.testing.assert_array_equal(getattr(again, name), column)
