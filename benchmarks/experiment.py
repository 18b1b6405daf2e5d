"""One experiment: a measure of one recording, by one method, with one change, in a process of its own.

Its result is kept by the contents of the package, so a second run, or one after an interruption, does only what is
missing. Called as a program, it performs the experiment that a file describes: `run.py` starts it so.
"""

import hashlib
import json
import math
import re
import subprocess
import sys
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any

import automos
from automos.core.atomic import write_text
from automos.core.errors import InputError, MissingExtraError
from automos.simulation import FORMAT

PACKAGE = Path(automos.__file__).parent
BESIDE_THE_METHOD = ("cli/", "writers/", "review/", "views/", "live/", "network/", "fleet/")
"""What shapes neither labels nor poses: changes there leave kept results as they are."""


@dataclass(frozen=True)
class Experiment:
    """What is measured.

    Attributes
    ----------
    measure : str
        "module:function" of this folder; it takes what follows and `store`, and returns plain numbers.
    recording, method, change : str
        See `recordings.py`; a preset or a published method; see `ablation.py`.
    options : dict
        Further arguments.
    is_of_everything : bool
        Whether its result is of the whole package, not of what shapes labels and poses alone.
    """

    measure: str
    recording: str = ""
    method: str = ""
    change: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    is_of_everything: bool = False

    def given(self) -> dict[str, Any]:
        """Return the arguments of the measure."""
        axes = {"recording": self.recording, "method": self.method, "change": self.change}
        return {name: value for name, value in axes.items() if value} | self.options

    def __str__(self) -> str:
        return ", ".join(map(str, [self.measure, *self.given().values()]))

    def file(self, store: Path) -> Path:
        """Return where its result is kept."""
        code = code_digest() if not self.is_of_everything else code_digest(())
        words = re.sub(r"[^\w.-]+", "_", str(self))[:80]
        digest = hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:8]
        return store / "results" / code / f"{words}-{digest}.json"


def result_of(experiment: Experiment, store: Path, again: bool = False) -> dict[str, Any]:
    """Return the result as one row: what was given, what was found, and its `head`; performed where it is not kept."""
    file = experiment.file(store)
    if again or not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        task = file.with_suffix(".task")
        write_text(task, json.dumps(asdict(experiment)))
        run = subprocess.run([sys.executable, __file__, task, file, store], check=False)
        task.unlink()
        if run.returncode != 0:
            return {**experiment.given(), "head": _head(f"failed: exit code {run.returncode}", experiment)}
    row = json.loads(file.read_text())
    if row["head"]["status"] != "done":
        file.unlink()  # a library may be installed later, a recording put there
    return row


def perform(experiment: Experiment, store: Path) -> dict[str, Any]:
    """Measure, in this process."""
    from automos.baselines.comparison.cost import Effort

    module, _, function = experiment.measure.partition(":")
    measure, status, found = getattr(import_module(module), function), "done", {}
    with Effort() as effort:
        try:
            found = measure(store=store, **experiment.given())
        except MissingExtraError as missing:
            status = f"left out: {missing}"
        except InputError as refusal:
            status = f"refused: {refusal}"
    cost = {"seconds": effort.seconds, "cpu_seconds": effort.busy, "peak_mb": effort.peak / 1e6}
    return rounded({**experiment.given(), **found, "head": _head(status, experiment) | cost})


def _head(status: str, experiment: Experiment) -> dict[str, Any]:
    """Return what a result is of; seconds and megabytes of the whole process are added where it ended."""
    head = {"commit": commit(), "date": datetime.now(UTC).date().isoformat(), "status": status}
    return head | {"settings": settings_digest(experiment.method, experiment.change)}


def settings_digest(method: str, change: str) -> str:
    """Return a text that changes with any setting that the experiment has."""
    from ablation import parsed

    from automos import load_settings
    from automos.core.stages import fingerprint
    from automos.settings import PRESETS

    overrides, constants = parsed(change)
    settings = load_settings(method if method in PRESETS else "default", None, overrides)
    return fingerprint(settings.model_dump(mode="json"), repr(constants))[:12]


def rounded(value: Any) -> Any:
    """Return `value` as JSON can have it: numbers to six digits, None for what is not finite."""
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: rounded(of) for key, of in value.items()}
    return [rounded(of) for of in value] if isinstance(value, list | tuple) else value


def code_digest(left_out: tuple[str, ...] = BESIDE_THE_METHOD) -> str:
    """Return a text that changes with any source file of the package but those in rooms that are left out."""
    digest = hashlib.sha256(str(FORMAT).encode())
    for path in sorted([*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.onnx")]):
        name = path.relative_to(PACKAGE).as_posix()
        if not (left_out and name.startswith(left_out)):
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


if __name__ == "__main__":
    task, out, store = map(Path, sys.argv[1:])
    write_text(out, json.dumps(perform(Experiment(**json.loads(task.read_text())), store)))
