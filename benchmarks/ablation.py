"""What each choice of the preset `default` is worth: labels with one of them taken back, on the same recordings.

    python benchmarks/ablation.py RECORDING [RECORDING ...] [--store FOLDER] [--choices NAME ...] [--scans N]
                                  [--json FILE]
    python benchmarks/ablation.py --gate 100 --store FOLDER [--sensors ...] [--json FILE]

A recording is a path or, with --store, a simulated world as scenario:sensor:scans:seed (`avenue:OS1-128:60:4`). Either
may be followed by @ and a case of `conventions.py` (`DRIVE@cut every 1.09 turns`, `city:VLP-16:40:2@dust`): then it is
kept and read as that recorder would, and the world needs no --store.
--gate takes all worlds of the gate's seed, without looking at them: the table gives what taking each choice back costs
each sensor on the mean, and the world that it costs, and gains, most. Scores of worlds are kept in FOLDER by the
contents of the package.
A choice is a setting, or a constant or function beside its code ("module:NAME" or "module:NAME.key"); a constant that
a compiled kernel reads as a global cannot be taken back so. The poses are estimated once a recording; only `poses not
refined` has others. The table gives the IoU of the moving class, and in brackets the false points, with everything and
with each choice taken back.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from conventions import CASES
from lines import show_lines
from rich.console import Console
from rich.table import Table
from robustness import Altered
from scores import code_digest
from store import stored_world

from automos import Workspace, label, load_settings, open_sequence
from automos.core.atomic import write_text
from automos.core.beam_pattern import BeamPattern
from automos.core.progress import StageProgress
from automos.core.scan import Mask, Points, Sequence
from automos.evaluation.moving import Counts, Scores, count
from automos.settings import PRESETS
from automos.simulation import SCENARIOS, record, write_recorded
from automos.simulation.recorders import Recorded, TurnsByAzimuth

NEVER = 1e9


def no_clouds(points: Points, is_between: npt.NDArray, is_object: Mask) -> Mask:
    """Return (M,) that no point is in a cloud, as `automos.evidence.clouds.in_clouds` does where there is none."""
    return np.zeros(len(points), np.bool_)


def all_possible(votes: npt.NDArray, pattern: BeamPattern, reach: npt.NDArray) -> Mask:
    """Return (H, W) that every possible ego body is one, whatever the votes of others on it."""
    return reach > 0.0


def all_constant(ends: npt.NDArray, *_: Any) -> Mask:
    """Return (H, W) that every part of a possible ego body stays put, in place of those that do."""
    return np.logical_or(*(ends > 0.0))


def everywhere(extents: list[npt.NDArray[np.float32]]) -> npt.NDArray[np.float32]:
    """Return (S,) an extent of 10 m in every direction, in place of the one that is learnt from those of the scans."""
    return np.full_like(extents[0], 10.0)


JUDGE, PAIRS = "automos.objects.judge", "automos.objects.association"
BODY = "automos.evidence.ego_body"
CHOICES: dict[str, dict[str, Any]] = {
    "everything": {},
    "poses not refined": {"odometry.refine": False},
    "evidence of 1 s only": {"candidates.free_space.spans": [0.2, 0.4, 0.6, 0.8, 1.0],
                             "automos.evidence.free_space:FIRST_SPANS": (0.6, 1.0)},
    "a lone point seen through counts in full": {"candidates.free_space.lone_weight": 1.0},
    "ERASOR instead of free space": {"candidates.method": "erasor"},
    "HDBSCAN instead of components": {"instances.method": "hdbscan"},
    "clouds are objects": {"automos.evidence.observations:in_clouds": no_clouds},
    "what rides along is an object": {f"{BODY}:MIN_SCANS": 10**9},
    "nothing is connected to the body": {"automos.evidence.on_body:ATTACHED_SHARE": NEVER},
    "all that is connected is body": {f"{BODY}:extent_in_most": everywhere},
    "all that keeps its range is body": {f"{BODY}:decide_body": all_possible},
    "edges of the body may move": {f"{BODY}:_stays_put": all_constant},
    "grazed faces keep their range": {f"{BODY}:GRAZING": 0.0},
    "within arm's reach all may be objects": {f"{BODY}:NEAR_SHARE": NEVER},
    "the walk on the ground begins level": {"automos.evidence.ground:PLANE_SHARE": 2.0},
    "objects of 20 m at most": {"instances.components.max_side": 20.0},
    "mixed segments stay whole": {"automos.objects.detect:MIXED_SHARE": 0.5},
    "where it went does not count": {f"{JUDGE}:WEIGHTS.displacement": 0.0},
    "unsteady things move, too": {f"{JUDGE}:WEIGHTS.unsteady": 0.0},
    "pieces are as good as wholes": {f"{JUDGE}:WEIGHTS.pieces": 0.0},
    "dust is as good as faces": {f"{JUDGE}:WEIGHTS.porous": 0.0},
    "more likely than not is moving": {"tracking.judge.min_probability": 0.5},
    "what overlaps may be another": {f"{PAIRS}:MIN_OVERLAP": 2.0},
    "objects may climb": {f"{PAIRS}:MAX_CLIMB": NEVER},
    "objects may lose their points": {f"{PAIRS}:MAX_COUNT_RATIO": NEVER},
    "sizes do not choose": {f"{PAIRS}:SIZE_WEIGHT": 0.0},
    "numbers of points do not choose": {f"{PAIRS}:COUNT_WEIGHT": 0.0},
    "evidence does not choose": {f"{PAIRS}:EVIDENCE_WEIGHT": 0.0},
    "what was lost may have stayed": {f"{PAIRS}:OTHER_EVIDENCE": NEVER},
    "a lost mover may pass its length in a second": {f"{PAIRS}:EVIDENCE_TIME": 0.0},
    "what has stayed is forgotten": {"automos.objects.tracker:STAYED": -1.0},
    "nothing is out of sight for long": {"tracking.max_gap": 0.0},
    "what movers pass by moves, too": {"automos.objects.places:OUTNUMBERED": NEVER},
    "ground beside objects stays ground": {"tracking.completion.margin": 0.0},
    "the paper's tracker and verdict": {f"tracking.{k}": v for k, v in PRESETS["paper"]["tracking"].items()},
}  # fmt: skip


OTHER_METHODS = (
    *("poses not refined", "ERASOR instead of free space", "HDBSCAN instead of components"),
    "the paper's tracker and verdict",
)
"""Choices of whole methods, not of a rule or a term."""


@contextmanager
def changed(constants: dict[str, Any]) -> Iterator[None]:
    """Give constants, by "module:NAME" or "module:NAME.key", other values for a while."""
    before = []
    for place, value in constants.items():
        module, _, name = place.partition(":")
        name, _, key = name.partition(".")
        owner: Any = import_module(module)
        holder, at = (getattr(owner, name), key) if key else (vars(owner), name)
        before.append((holder, at, holder[at]))
        holder[at] = value
    try:
        yield
    finally:
        for holder, at, value in before:
            holder[at] = value


def opened(recording: str, store: Path | None, cache: Path) -> Sequence:
    """Return a recording by its path, or a simulated world of `store` by its name; with @ as a recorder keeps it."""
    recording, _, name = recording.partition("@")
    is_world = not Path(recording).exists() and recording.count(":") == 3
    if not name and (not is_world or store is None):
        return open_sequence(Path(recording))
    if not is_world:
        kept = Recorded(TurnsByAzimuth(open_sequence(Path(recording))), CASES[name].convention)
    else:
        scenario, sensor, n_scans, seed = recording.split(":")
        if not name:
            return stored_world(store, scenario, sensor, int(n_scans), int(seed))
        about = {key: getattr(CASES[name], key) for key in ("convention", "conditions", "n_lidars")}
        kept = record(scenario, sensor, int(n_scans), int(seed), **about)
    return open_sequence(write_recorded(kept, cache / f"{recording.split('/')[-1].replace(':', '-')}, {name}"))


def scores(
    sequence: Sequence, n_scans: int | None, choice: dict[str, Any], cache: Path, progress: StageProgress
) -> Scores:
    folder = cache / sequence.name
    sequence = Altered(sequence, np.arange(len(sequence))[:n_scans])
    constants = {place: value for place, value in choice.items() if ":" in place}
    overrides = {key: value for key, value in choice.items() if key not in constants}
    workspace = Workspace(folder) if "odometry.refine" not in overrides else Workspace()
    _forget(folder, constants)
    with changed(constants):
        result = label(sequence, load_settings("default", None, overrides), workspace=workspace, progress=progress)
        counts = sum((count(result.labels(i), sequence.truth(i)) for i in range(len(sequence))), Counts())
    _forget(folder, constants)
    return counts.scores


def stages_from(place: str) -> tuple[str, ...]:
    """Return the stages that a constant, by "module:NAME", shapes."""
    stages, room = ("candidates", "instances", "tracking", "labels"), place.split(".")[1]
    return stages[stages.index("candidates" if room in ("ground", "sensor") else room) :]


def _forget(folder: Path, constants: dict[str, Any]) -> None:
    """Remove the stages that `constants` shape: stages are found again by their settings, which do not know of them."""
    for place in constants:
        for name in stages_from(place):
            for stage in folder.glob(f"stages/{name}-*"):
                shutil.rmtree(stage)


def kept_row(file: Path, measure: Callable[[], Scores]) -> dict[str, Any]:
    """Return IoU and false points, those of `file` where it is there; else measured, and kept there."""
    if not file.exists():
        found = measure()
        file.parent.mkdir(parents=True, exist_ok=True)
        write_text(file, json.dumps({"iou": found.iou, "false": found.false_dynamic}))
    return json.loads(file.read_text())


def over_the_gate(seed: int, choices: list[str], sensors: list[str], store: Path) -> list[list[str]]:
    """Return heading and lines: choice, points of IoU that taking it back costs by sensor, most in one world, false."""
    rows: dict[tuple[str, str, str], dict] = {}
    kept = store / "ablation" / code_digest()
    for sensor in sensors:
        for scenario in SCENARIOS:
            with tempfile.TemporaryDirectory() as cache:
                for choice in choices:
                    world = f"{scenario}-{sensor}-{seed}"
                    with StageProgress(Console(stderr=True), f"{world}, {choice}") as progress:
                        rows[choice, scenario, sensor] = kept_row(
                            kept / f"{world}-{choice.replace(' ', '_')}.json",
                            lambda s=scenario, t=sensor, c=choice, f=cache, p=progress: scores(  # type: ignore[misc]
                                stored_world(store, s, t, 60, seed), None, CHOICES[c], Path(f), p
                            ),
                        )
    lines = [["", *sensors, "most lost", "most won", "false points"]]
    for choice in choices:
        worlds = [(scenario, sensor) for scenario in SCENARIOS for sensor in sensors]
        lost = {w: 100.0 * (rows["everything", *w]["iou"] - rows[choice, *w]["iou"]) for w in worlds}
        lost = {w: points for w, points in lost.items() if np.isfinite(points)}  # not where nothing moves
        by_sensor = [f"{np.mean([v for w, v in lost.items() if w[1] == sensor]):+.2f}" for sensor in sensors]
        worst, best = max(lost, key=lambda w: lost[w]), min(lost, key=lambda w: lost[w])
        most = [f"{sign * lost[w]:.1f} {' '.join(w)}" for sign, w in ((1, worst), (-1, best))]
        lines.append([choice, *by_sensor, *most, f"{sum(rows[choice, *w]['false'] for w in worlds):,}"])
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="*")
    parser.add_argument("--gate", type=int, help="seed of the gate's worlds, all of them")
    parser.add_argument("--sensors", nargs="+", default=["HDL-64E", "OS1-128", "VLP-16"])
    parser.add_argument("--store", type=Path, help="folder of simulated worlds")
    parser.add_argument("--choices", nargs="+", default=list(CHOICES), choices=list(CHOICES))
    parser.add_argument("--scans", type=int, help="the first so many of each recording")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    if arguments.gate is not None:
        rules = [name for name in arguments.choices if name not in OTHER_METHODS]
        names = ["everything", *(name for name in rules if name != "everything")]
        lines = over_the_gate(arguments.gate, names, arguments.sensors, arguments.store)
        show_lines(lines, arguments.json, "points of IoU that taking each choice back costs")
        return
    rows = []
    with tempfile.TemporaryDirectory() as cache:
        sequences = [opened(recording, arguments.store, Path(cache) / "kept") for recording in arguments.recordings]
        table = Table("", *(sequence.name for sequence in sequences), title="IoU % (false points)")
        for choice in arguments.choices:
            cells = []
            for sequence in sequences:
                name = sequence.name
                with StageProgress(Console(stderr=True), f"{name}, {choice}") as progress:
                    found = scores(sequence, arguments.scans, CHOICES[choice], Path(cache), progress)
                cells.append(f"{100 * found.iou:.1f} ({found.false_dynamic:,})")
                rows.append({"choice": choice, "recording": name, "iou": found.iou, "false": found.false_dynamic})
            table.add_row(choice, *cells)
            Console().print(f"{choice}: {', '.join(cells)}")
    Console().print(table)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows))


if __name__ == "__main__":
    main()
