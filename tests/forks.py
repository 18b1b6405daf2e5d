"""Calls in a forked process, which has a single thread: what other tests left running in theirs stays behind."""

import json
import os
import signal
import traceback
import tracemalloc
from collections.abc import Callable
from typing import Any

import pytest

TRACED_PATIENCE = 60
"""Seconds: what is traced is several times as slow."""


def in_a_fork(call: Callable[[], Any], patience: int = 10) -> Any:
    """Return what `call` returns in a forked process, as JSON holds it; skip where systems do not fork.

    Raises
    ------
    AssertionError
        It raised, or did not return in `patience` seconds.
    """
    if not hasattr(os, "fork"):
        pytest.skip("this system has no forks")
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        signal.alarm(patience)
        with os.fdopen(writer, "w") as answer:
            try:
                json.dump([call(), ""], answer)
            except BaseException:
                json.dump([None, traceback.format_exc()], answer)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as answer:
        said = answer.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert code == 0, f"the forked process ended with {code}"
    result, error = json.loads(said)
    assert not error, error
    return result


def peak_memory(call: Callable[[], Any]) -> int:
    """Return how many bytes `call` holds at its peak.

    In a fork: before Python 3.12.9 and 3.13.2 the end of `tracemalloc` crashes if a thread allocates at that moment.
    """

    def traced() -> int:
        tracemalloc.start()
        call()
        return tracemalloc.get_traced_memory()[1]

    return int(in_a_fork(traced, TRACED_PATIENCE))
