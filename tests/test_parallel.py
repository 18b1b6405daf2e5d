import os

import pytest

from automos.errors import InputError
from automos.parallel import available_cores, checked_workers, map_in_order


def square(x: int) -> int:
    return x * x


def process_of(x: int) -> tuple[int, int]:
    return x, os.getpid()


def refuse_seven(x: int) -> int:
    if x == 7:
        raise ValueError("seven")
    return x


def test_there_is_at_least_one_core():
    assert 1 <= available_cores() <= (os.cpu_count() or 1)


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_order_whatever_the_number_of_workers(workers):
    # 20 items in chunks of 3 a worker: several rounds, the last one not full
    assert list(map_in_order(square, range(20), workers, chunk=3)) == [x * x for x in range(20)]


@pytest.mark.parametrize("workers", [0, 1, 2])
def test_no_items_give_no_results(workers):
    assert list(map_in_order(square, [], workers)) == []


def test_one_worker_is_this_process_and_several_are_others():
    assert {pid for _, pid in map_in_order(process_of, range(4), 1)} == {os.getpid()}
    assert os.getpid() not in {pid for _, pid in map_in_order(process_of, range(4), 2)}


@pytest.mark.parametrize("workers", [1, 2])
def test_items_are_taken_only_a_chunk_ahead(workers):
    taken = []

    def items():
        for x in range(1000):
            taken.append(x)
            yield x

    results = map_in_order(square, items(), workers, chunk=5)
    next(results)
    assert len(taken) <= 5 * workers
    results.close()


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_of_one_item_is_raised_after_the_results_before_its_chunk(workers):
    results = map_in_order(refuse_seven, range(10), workers, chunk=2)
    got = [next(results) for _ in range(4)]
    assert got == [0, 1, 2, 3]
    with pytest.raises(ValueError, match="seven"):
        list(results)


@pytest.mark.parametrize("workers", [-1, "two", 1.5, None])
def test_what_is_no_number_of_workers_is_told(workers):
    with pytest.raises(InputError, match="workers are 0, one per core"):
        checked_workers(workers)
