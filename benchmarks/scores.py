"""Scores of the installed code, kept by its contents: a second run labels only what is missing."""

from __future__ import annotations

import hashlib
import json
import math
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy.typing as npt
from rich.console import Console
from suite import measure

import automos
from automos.core.atomic import write_text
from automos.core.errors import InputError
from automos.core.progress import StageProgress
from automos.core.scan import Sequence
from automos.evaluation.moving import Counts
from automos.simulation import FORMAT

PACKAGE = Path(automos.__file__).parent


class Scores:
    """Rows of `suite.measure`, one file a recording, in a folder of this very code; new ones unless `scored_only`."""

    def __init__(self, store: Path, preset: str, workers: int, scored_only: bool = False):
        self._scored_only = scored_only
        self._folder = store / "scores" / f"{code_digest()}-{preset}"
        self._preset, self._workers, self._is_warm = preset, workers, False

    def of(self, name: str, open_recording: Callable[[StageProgress], Sequence], bodies: Any = None) -> dict:
        """Return the row of recording `name`; `open_recording(progress)` gives it if need be.

        A recording that is refused has a row with the reason only, one without scores that should not be labelled now
        an empty one. `bodies` as for `suite.measure`.
        """
        file = self._folder / f"{name.replace(' ', '_').replace(',', '')}.json"
        if not file.exists() and self._scored_only:
            return {}
        if not file.exists():
            self._folder.mkdir(parents=True, exist_ok=True)
            with StageProgress(Console(stderr=True), name) as progress:
                try:
                    row = self._measured(open_recording(progress), bodies, progress)
                except InputError as refusal:
                    row = {"refused": str(refusal)}
            write_text(file, json.dumps(row))
        return json.loads(file.read_text())

    def _measured(self, sequence: Sequence, bodies: Any, progress: StageProgress) -> dict:
        run = self._folder / f"run-{os.getpid()}"
        if not self._is_warm:  # kernels are compiled once; that is not what is measured
            measure(First(sequence, 12), self._preset, run, self._workers, progress)
            self._is_warm = True
        return measure(sequence, self._preset, run, self._workers, progress, bodies)


class First(Sequence):
    """The first scans of a recording."""

    def __init__(self, inner: Sequence, n: int):
        self._inner, self._n, self.name = inner, min(n, len(inner)), inner.name

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, index: int) -> Any:
        return self._inner[index]

    @property
    def stamps(self) -> npt.NDArray | None:
        return None if self._inner.stamps is None else self._inner.stamps[: self._n]

    @property
    def is_compensated(self) -> bool | None:
        return self._inner.is_compensated

    def truth(self, index: int) -> npt.NDArray | None:
        return self._inner.truth(index)


BESIDE_THE_METHOD = (
    *("cli", "simulation/", "datasets/", "export/", "evaluation/", "review/", "visualization/", "results/"),
    *("live/", "network/", "learning/", "scale/", "demo"),
)
"""What shapes no labels: how recordings are read and what becomes of labels has tests of its own."""


def finite(values: dict[str, float]) -> dict[str, float | None]:
    """Return `values` as JSON can have them: None for what is not defined."""
    return {name: value if math.isfinite(value) else None for name, value in values.items()}


def ratios_of(counts: Counts) -> dict[str, float | None]:
    """Return IoU, precision and recall of the moving class, None for what is not defined."""
    scores = counts.scores
    return finite({"iou": scores.iou, "precision": scores.precision, "recall": scores.recall})


def code_digest(rooms: tuple[str, ...] = (), also: tuple[str, ...] = ()) -> str:
    """Return a text that changes with any source file of the method, and with the simulator's worlds.

    Where `rooms` are named, only files whose paths begin with one of them count; those of `also` count in any case.
    The network that comes along is one of them.
    """
    digest = hashlib.sha256(str(FORMAT).encode())
    for path in sorted([*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.onnx")]):
        name = path.relative_to(PACKAGE).as_posix()
        of_method = name.startswith(rooms) if rooms else not name.startswith(BESIDE_THE_METHOD)
        if of_method or name.startswith(also):
            digest.update(name.encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def commit() -> str:
    """Return the short commit that changed the package's source last, with a + where files differ from it."""
    git = ["git", "-C", str(PACKAGE)]
    last = [*git, "log", "-1", "--abbrev=7", "--format=%h", "--", "."]
    found = subprocess.run(last, capture_output=True, text=True, check=False)
    if found.returncode != 0:
        return code_digest()
    is_clean = subprocess.run([*git, "diff", "--quiet", "HEAD", "--", "."], check=False).returncode == 0
    return found.stdout.strip() + ("" if is_clean else "+")
