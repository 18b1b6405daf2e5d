"""What labels lose when a recording gets worse: noisy poses, missing scans and points, other rates, directions, mounts.

    python benchmarks/robustness.py RECORDING [RECORDING ...] [--preset default] [--cases NAME ...] [--scans N]
                                       [--json FILE]

Each recording (with labels) is labelled as it is and in every altered form, poses estimated, the same settings; the
table gives the IoU of the moving class and what it lost. Only scans that the altered recording still has are counted.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from automos import label, load_settings, open_sequence
from automos.core.geometry import make_transform, transform
from automos.core.progress import StageProgress
from automos.core.scan import Scan, Sequence
from automos.evaluation.moving import Counts, count
from automos.odometry import estimate_trajectory
from automos.settings import Settings


class Altered(Sequence):
    """Some scans of a sequence in some order, each of them changed."""

    def __init__(
        self,
        inner: Sequence,
        order: npt.NDArray[np.int64],
        keep: Callable[[int, Scan], npt.NDArray] | None = None,
        T: npt.NDArray[np.float64] | None = None,
    ):
        """Take the scans `order` of `inner`; of scan i the points `keep(i, scan)`; seen by a sensor turned by `T`."""
        self._inner, self._order, self._keep, self._T = inner, order, keep, T
        self.name = inner.name

    def __len__(self) -> int:
        return len(self._order)

    def _kept(self, index: int) -> npt.NDArray | slice:
        return slice(None) if self._keep is None else self._keep(index, self._inner[int(self._order[index])])

    def __getitem__(self, index: int) -> Scan:
        scan = self._inner[int(self._order[index])]
        points = scan.points if self._T is None else transform(self._T, scan.points)
        time = scan.time
        if time is not None and self._is_backwards:
            time = -time
        kept = self._kept(index)
        columns = {
            name: None if column is None else column[kept]
            for name, column in (("intensity", scan.intensity), ("ring", scan.ring), ("time", time))
        }
        return replace(scan, points=points[kept], stamp=None, name="", **columns)

    @property
    def _is_backwards(self) -> bool:
        return len(self._order) > 1 and bool(self._order[0] > self._order[-1])

    @property
    def stamps(self) -> npt.NDArray[np.float64] | None:
        stamps = self._inner.stamps
        if stamps is None:
            return None
        return -stamps[self._order] if self._is_backwards else stamps[self._order]

    @property
    def is_compensated(self) -> bool | None:
        return self._inner.is_compensated

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        found = self._inner.truth(int(self._order[index]))
        return None if found is None else found[self._kept(index)]


def half_of_the_points(index: int, scan: Scan) -> npt.NDArray[np.bool_]:
    return np.random.default_rng(index).random(len(scan)) < 0.5


def turned(*degrees: float) -> npt.NDArray[np.float64]:
    return make_transform(Rotation.from_euler("xyz", degrees, degrees=True).as_matrix())


CASES: dict[str, Callable[[Sequence], Sequence]] = {
    "as it is": lambda s: Altered(s, np.arange(len(s))),
    "every 2nd scan": lambda s: Altered(s, np.arange(0, len(s), 2)),
    "half the points": lambda s: Altered(s, np.arange(len(s)), half_of_the_points),
    "reversed": lambda s: Altered(s, np.arange(len(s))[::-1]),
    "tilted by 5 degrees": lambda s: Altered(s, np.arange(len(s)), T=turned(3.0, 4.0, 0.0)),
    "upside down": lambda s: Altered(s, np.arange(len(s)), T=turned(180.0, 0.0, 0.0)),
    "noisy poses": lambda s: Altered(s, np.arange(len(s))),
}
"""What is done to a recording. With `noisy poses`, the estimated poses are disturbed by 5 cm and 0.1 degrees a scan."""


def noisy(poses: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return `poses` (N, 4, 4), each disturbed by a standard deviation of 5 cm and 0.1 degrees in all."""
    rng = np.random.default_rng(0)
    shift, turn = rng.standard_normal((2, len(poses), 3)) / np.sqrt(3.0)
    noise = [
        make_transform(Rotation.from_rotvec(np.radians(0.1) * r).as_matrix(), 0.05 * t)
        for t, r in zip(shift, turn, strict=True)
    ]
    return poses @ np.array(noise)


def iou(sequence: Sequence, settings: Settings, case: str, progress: StageProgress) -> float:
    poses = noisy(estimate_trajectory(sequence, settings.odometry).T_world_sensor) if case == "noisy poses" else None
    result = label(sequence, settings, poses=poses, progress=progress)
    counts = (count(result.labels(i), sequence.truth(i)) for i in range(len(sequence)))
    return sum(counts, Counts()).scores.iou


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--preset", default="default")
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=list(CASES))
    parser.add_argument("--scans", type=int, help="the first so many of each recording")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    settings, found = load_settings(arguments.preset), {}
    table = Table("", *(path.name for path in arguments.recordings), title="IoU % (change)")
    for case in arguments.cases:
        row = []
        for path in arguments.recordings:
            with StageProgress(Console(stderr=True), f"{path.name}, {case}") as progress:
                sequence = open_sequence(path)
                sequence = Altered(sequence, np.arange(len(sequence))[: arguments.scans])
                found[case, path.name] = iou(CASES[case](sequence), settings, case, progress)
            change = found[case, path.name] - found.get(("as it is", path.name), float("nan"))
            row.append(f"{100 * found[case, path.name]:.1f} ({100 * change:+.1f})")
        table.add_row(case, *row)
        Console().print(f"{case}: {', '.join(row)}")
    Console().print(table)
    if arguments.json:
        arguments.json.write_text(json.dumps([{"case": c, "recording": r, "iou": v} for (c, r), v in found.items()]))


if __name__ == "__main__":
    main()
