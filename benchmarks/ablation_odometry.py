"""What each part of the odometry is worth: drives whose poses are off where it is left out.

    python benchmarks/ablation_odometry.py --store STORE [--seeds 110 111] [--scans 40] [--parts NAME ...] [--json FILE]

Simulated drives on which odometry is in danger of slipping, with and without scans missing, by few beams and many; a
drive is off where a third of it is, by more than 3 % (`trust.py`). Nothing was chosen on the seeds above.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

import numpy as np
from lines import show_lines
from rich.console import Console
from store import stored_world
from trust import OFF, SAYS_SO, speed_error

from automos import ArraySequence, load_settings
from automos.core.progress import StageProgress
from automos.core.scan import Sequence
from automos.odometry import estimate_trajectory, facing, kiss, missing_scans, refine, speed
from automos.odometry.speed import NOTHING, SpeedSearch, search_speed

SCENARIOS = ("motorway", "canyon", "slowdown", "avenue")
SENSORS = ("VLP-16", "HDL-64E")
MISSING = 7
"""Every so many-th scan is left out of the second form of each drive, and its stamps with it."""


def _without_direction(window, settings, pool=None) -> SpeedSearch:  # type: ignore[no-untyped-def]
    is_known = speed.direction_of(window.steps) is not None
    if is_known:
        return search_speed(window, settings, pool)
    nothing = np.zeros((len(window) - 1, 3))
    return SpeedSearch(nothing, nothing, NOTHING, NOTHING)


def _none_missing(window, settings, pool=None):  # type: ignore[no-untyped-def]
    return window.gaps


def _as_registered(window, settings, pool=None):  # type: ignore[no-untyped-def]
    return window


def _nothing_refound(window, overhead, pool):  # type: ignore[no-untyped-def]
    return np.zeros((len(window) - 1, len(missing_scans.TRIED)))


PARTS: dict[str, list[tuple[object, str, object]]] = {
    "everything": [],
    "starts at other speeds": [(kiss, "_find_start", lambda rest, *others: rest)],
    "a search for the speed": [(refine, "SPEED_ROUNDS", 1), (refine, "lengthen", lambda T, longer: T)],
    "a search where the sensor seems to stand": [(refine, "search_speed", _without_direction)],
    "the rival that landmarks propose": [(refine, "is_ahead", lambda *evidence: False)],
    "isolated points": [
        (facing, "count_met_again", lambda *met: 0.0),
        (missing_scans, "count_met_again", lambda *met: 0.0),
    ],
    "missing scans counted": [(refine, "count_missing", _none_missing)],
    "missing scans counted by what faces along the path": [(missing_scans, "refound_after", _nothing_refound)],
    "missing scans counted at the speed that is searched first": [(missing_scans, "to_likely_speed", _as_registered)],
}
"""What is left out, and the attributes that are replaced for it."""


@contextmanager
def left_out(part: str) -> Iterator[None]:
    """Leave a part out for as long as the context lasts."""
    patches = [mock.patch.object(*patch) for patch in PARTS[part]]
    for patch in patches:
        patch.start()
    try:
        yield
    finally:
        mock.patch.stopall()


def drives(
    store: Path, seeds: list[int], n_scans: int
) -> Iterator[tuple[str, Callable[[], tuple[Sequence, np.ndarray]]]]:
    """Yield the name of each drive, and what gives its scans and its true poses."""
    for seed in seeds:
        for scenario in SCENARIOS:
            for sensor in SENSORS:
                for is_complete in (True, False):
                    kept = [i for i in range(n_scans) if is_complete or i % MISSING != MISSING - 1]

                    def opened(asked=(scenario, sensor, n_scans, seed), kept=kept, is_complete=is_complete):  # type: ignore[no-untyped-def]
                        with StageProgress(Console(stderr=True, quiet=True), "") as progress:
                            world = stored_world(store, *asked, progress)
                        scans = [world[i].points for i in kept]
                        return ArraySequence(scans, world.stamps if is_complete else None), world.reference_poses[kept]

                    yield f"{scenario} {sensor} {seed}{'' if is_complete else ', scans missing'}", opened


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--seeds", nargs="+", type=int, default=[110, 111])
    parser.add_argument("--scans", type=int, default=40)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    settings = load_settings("default").odometry
    off: dict[str, dict[str, tuple[float, bool]]] = {part: {} for part in arguments.parts}
    for name, opened in drives(arguments.store, arguments.seeds, arguments.scans):
        sequence, true = opened()
        for part in arguments.parts:
            with left_out(part):
                found = estimate_trajectory(sequence, settings)
            is_warned = any(SAYS_SO.search(text) for text in found.diagnostics["warnings"])
            off[part][name] = (speed_error(found.T_world_sensor, true), is_warned)
    lines = [
        ["without", "drives off by more than 3 %", "of these, scans missing", "not warned of", "mean of the others"]
    ]
    for part, of_drives in off.items():
        bad = {name: found for name, found in of_drives.items() if found[0] > OFF}
        others = [found[0] for name, found in of_drives.items() if name not in bad]
        n_missing, n_silent = sum("missing" in name for name in bad), sum(not warned for _, warned in bad.values())
        head = "(nothing)" if part == "everything" else part
        lines.append(
            [head, f"{len(bad)} of {len(of_drives)}", str(n_missing), str(n_silent), f"{100 * np.mean(others):.2f} %"]
        )
    show_lines(lines, arguments.json)


if __name__ == "__main__":
    main()
