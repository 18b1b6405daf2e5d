import ctypes
import os
import subprocess
import sys
import threading
import time

import psutil
import pytest

from automos.core.errors import InputError
from automos.core.parallel import available_cores, checked_workers, map_in_order, map_in_shares, one_ahead


def square(x: int) -> int:
    return x * x


def process_of(x: int) -> tuple[int, int]:
    return x, os.getpid()


def refuse_seven(x: int) -> int:
    if x == 7:
        raise ValueError("seven")
    return x


HEAPS_OF_THREADS = """
import ctypes, threading
from automos.cli.memory import share_heap
{}
libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
waiting = threading.Barrier(5)
def take():
    libc.malloc(ctypes.c_size_t(1000))
    waiting.wait()
threads = [threading.Thread(target=take) for _ in range(4)]
for thread in threads:
    thread.start()
waiting.wait()
libc.malloc_info(0, ctypes.c_void_p.in_dll(libc, "stdout"))
libc.fflush(None)
"""


def test_a_few_items_need_no_task():
    assert map_in_shares(None, square, range(7)) == [0, 1, 4, 9, 16, 25, 36]  # type: ignore[arg-type]


@pytest.mark.skipif(not (sys.platform == "linux" and hasattr(ctypes.CDLL(None), "malloc_info")), reason="no glibc")
def test_threads_share_one_heap_where_they_are_asked_to():
    def heaps(call: str) -> int:
        script = HEAPS_OF_THREADS.format(call)
        told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60)
        return told.stdout.count("<heap nr=")

    assert heaps("share_heap()") == 1 < heaps("")


GAPS = """
import psutil
from automos.core.parallel import return_memory
kept = []
for _ in range(2000):
    block, small = bytearray(60_000), bytearray(3000)
    kept += [block, small]
del kept[::2], block
before = psutil.Process().memory_info().rss
return_memory()
print((before - psutil.Process().memory_info().rss) >> 20)
"""


@pytest.mark.skipif(not (sys.platform == "linux" and hasattr(ctypes.CDLL(None), "malloc_trim")), reason="no glibc")
def test_memory_between_what_is_kept_goes_back_to_the_system():
    told = subprocess.run([sys.executable, "-c", GAPS], capture_output=True, text=True, check=True, timeout=60)
    assert int(told.stdout) > 50  # MB, of 120


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


@pytest.mark.parametrize("workers", [10**20, -1, "two", 1.5, None])
def test_what_is_no_number_of_workers_is_told(workers):
    with pytest.raises(InputError, match="workers are 0, one per core"):
        checked_workers(workers)


def test_one_is_computed_ahead_and_no_more():
    begun = []

    def noted(item):
        begun.append(item)
        return item

    for given in one_ahead(noted, iter(range(6)), ends=lambda item: item == 3):
        wait_until(lambda given=given: len(begun) == min(given + 2, 6) if given != 3 else True)
        time.sleep(0.01)
        assert begun == list(range(4 if given == 3 else min(given + 2, 6)))


def test_what_goes_wrong_ahead_is_raised_after_the_results_before_it():
    ahead = one_ahead(lambda x: 1 / x, [1, 2, 0, 4], ends=lambda result: False)
    assert [next(ahead), next(ahead)] == [1.0, 0.5]
    with pytest.raises(ZeroDivisionError):
        next(ahead)


def test_a_caller_that_stops_does_not_wait_for_items_that_never_come():
    comes, begun = threading.Event(), []

    def items():
        yield 1
        comes.wait(20.0)
        yield 2

    ahead = one_ahead(lambda item: begun.append(item) or item, items(), ends=lambda result: False)
    assert next(ahead) == 1
    start = time.monotonic()
    ahead.close()
    assert time.monotonic() - start < 5.0
    comes.set()
    time.sleep(0.05)
    assert begun == [1]


def wait_until(is_so, seconds=5.0):
    end = time.monotonic() + seconds
    while not is_so() and time.monotonic() < end:
        time.sleep(0.001)
    return is_so()


WAITING = """
import os, sys, time
from automos.core.parallel import map_in_order

def wait(path):
    open(path, "w").write(str(os.getpid()))
    time.sleep(60)

list(map_in_order(wait, sys.argv[1:], 2))
"""


@pytest.mark.skipif(os.name != "posix", reason="elsewhere the number of the parent stays")
def test_workers_do_not_outlive_a_parent_that_is_killed(tmp_path):
    paths = [tmp_path / name for name in "ab"]
    parent = subprocess.Popen([sys.executable, "-c", WAITING, *paths], stderr=subprocess.DEVNULL)
    assert wait_until(lambda: all(path.exists() and path.read_text() for path in paths), 60.0)
    workers = [psutil.Process(int(path.read_text())) for path in paths]
    parent.kill()
    parent.wait()
    assert wait_until(lambda: not any(w.is_running() and w.status() != psutil.STATUS_ZOMBIE for w in workers), 30.0)
