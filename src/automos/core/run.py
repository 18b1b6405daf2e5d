"""The stages of one run: which results exist, which are missing, and how long each stage took."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager

import numpy.typing as npt

from automos.core.blas import one_blas_thread
from automos.core.parallel import return_memory
from automos.core.stages import Arrays, Stage, Stages

Progress = Callable[[str, int, int], None]
"""Called with a stage's name, the scans done and their total."""
Tick = Callable[[int, int], None]
"""The same of one stage."""


def silent(name: str, done: int, total: int) -> None:
    """Tell nobody of progress."""


class Run:
    """Runs stages whose results are not there yet."""

    def __init__(self, stages: Stages, keys: dict[str, str], names: list[str], progress: Progress | None = None):
        """Take where results are kept, each stage's fingerprint, and the scans' names."""
        self.keys = keys
        self.names = names
        self.seconds = dict.fromkeys(keys, 0.0)
        self._stages = stages
        self._progress = progress or silent

    def once(self, name: str, make: Callable[[Tick], Arrays]) -> dict[str, npt.NDArray]:
        """Return the results of a stage that treats the recording as a whole; `make` is given a progress callback."""
        stage = self._stages.stage(name, self.keys[name])
        if not stage.has("all"):
            with self._timed(name):
                stage.save("all", make(lambda done, total: self._progress(name, done, total)))
        return stage.load("all")

    def each(
        self, name: str, make: Callable[[list[int]], Iterable[tuple[int, Arrays]]], scans: range | None = None
    ) -> Stage:
        """Return a stage with results for every scan, or for `scans` at least.

        `make` is given the missing ones and yields them in order.
        """
        scans = range(len(self.names)) if scans is None else scans
        stage = self._stages.stage(name, self.keys[name])
        missing = [i for i in scans if not stage.has(self.names[i])]
        if missing:
            with self._timed(name):
                done = len(scans) - len(missing)
                for i, arrays in make(missing):
                    stage.save(self.names[i], arrays)
                    done += 1
                    self._progress(name, done, len(scans))
        return stage

    def fill(self, name: str, results: Mapping[str, Arrays]) -> None:
        """Take `results` of a stage, by scan or as "all", as if it had made them."""
        stage = self._stages.stage(name, self.keys[name])
        for key, arrays in results.items():
            stage.save(key, arrays)

    @contextmanager
    def _timed(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        with one_blas_thread():
            yield
        return_memory()
        self.seconds[name] = time.perf_counter() - start
