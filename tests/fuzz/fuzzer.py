"""Damage inputs of every kind, and count what becomes of them: python tests/fuzz/fuzzer.py --inputs 5000 [--seed 0].

In pieces: --inputs 500 --seed 0, --inputs 500 --seed 500, and so on, are the same inputs.
"""

import argparse
import json
import queue
import resource
import signal
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path

PATIENCE = 60
"""Seconds of processor time that one input may take; labelling compiles at first."""
WAITING = 1200.0
"""Seconds that one input may take by the clock: much, since a machine that is busy elsewhere makes no input hang."""
MEMORY = 8 << 30
"""Bytes of address space of the process that reads."""
OUTCOMES = ("refused", "accepted", "traceback", "crash", "hang", "wrong")
RARE = dict.fromkeys(("label", "label again", "given poses", "fleet", "review", "view", "report", "load", "map"), 0.004)
"""Kinds that take long, and their share."""
SLOW = (*RARE, "values")


class Reader:
    """A process that reads damaged inputs, and is begun anew where one ends it."""

    def __init__(self) -> None:
        self._start()

    def _start(self) -> None:
        limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))  # noqa: E731
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).parent / "child.py")],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, preexec_fn=limit,
        )  # fmt: skip
        self._lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._listen, args=(self._process, self._lines), daemon=True).start()
        self.kinds = json.loads(self._lines.get(timeout=WAITING))

    @staticmethod
    def _listen(process: subprocess.Popen, lines: queue.Queue[str]) -> None:
        for line in process.stdout:
            lines.put(line)
        lines.put("")

    def read(self, kind: str, seed: int) -> tuple[str, str]:
        """Return what became of an input."""
        self._process.stdin.write(f"{kind} {seed} {4 * PATIENCE if kind in SLOW else PATIENCE}\n")
        self._process.stdin.flush()
        try:
            line = self._lines.get(timeout=WAITING)
        except queue.Empty:
            line = None
        if line:
            outcome, why = json.loads(line)
            return outcome, why
        self._process.kill()
        code = self._process.wait()
        self._start()
        if line is None:
            return "hang", f"no answer after {WAITING:.0f} s"
        return ("hang", "processor time is used up") if code == -signal.SIGPROF else ("crash", f"exit code {code}")

    def end(self) -> None:
        """End the process."""
        self._process.stdin.close()
        self._process.wait(timeout=WAITING)


def fuzz(
    n_inputs: int, seed: int, only: str | None = None, tell: bool = True
) -> tuple[dict[str, Counter[str]], list[str]]:
    """Return by kind how often each outcome came, and a line for each that must not be.

    An input is told by its number alone, from `seed` on: a long run may be done in pieces.
    """
    reader, faults = Reader(), []
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in reader.kinds}
    usual = [kind for kind in reader.kinds if kind not in RARE]
    for number in range(seed, seed + n_inputs):
        rare = next(
            (kind for k, (kind, share) in enumerate(RARE.items()) if (number + k) % round(1 / share) == 0), None
        )
        kind = only or rare or usual[number % len(usual)]
        outcome, why = reader.read(kind, number)
        counts[kind][outcome] += 1
        if outcome not in ("refused", "accepted"):
            faults.append(f"{outcome}: {kind} {number}: {why}")
            if tell:
                print(faults[-1], flush=True)
    reader.end()
    return counts, faults


def main() -> int:
    """Print a table of outcomes by kind; exit code 1 where there is one that must not be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0, help="number of the first input")
    parser.add_argument("--kind", help="read inputs of this kind only")
    chosen = parser.parse_args()
    counts, faults = fuzz(chosen.inputs, chosen.seed, chosen.kind)
    total = sum(counts.values(), Counter())
    print(f"{'':18}" + "".join(f"{outcome:>10}" for outcome in OUTCOMES))
    for kind, found in [*counts.items(), ("all", total)]:
        print(f"{kind:18}" + "".join(f"{found[outcome]:>10}" for outcome in OUTCOMES))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
