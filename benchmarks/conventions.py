"""What recorders' conventions cost: labels of the same drives, cut, ordered and timed otherwise, or driven otherwise.

    python benchmarks/conventions.py --store FOLDER [--conventions NAME ...] [--scenarios ...] [--sensors ...]
                                     [--scans 40] [--seed 17] [--preset default] [--workers 1] [--json FILE]

Each simulated drive is written as each recorder would have kept it, read back and labelled; the table gives the IoU of
the moving class as it is and what each convention costs, in points, the mean over the scenarios, by sensor. "refused"
is a recording that is not read. What a carrier costs (hull, trailer, operator) is measured against the same drive with
its points left out. Points on the carrier, drops and dust are not scored: the shares of them called moving are given.
Scores are kept in FOLDER by the contents of the package.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
from lines import show_lines
from scores import Scores

from automos import open_sequence
from automos.core.progress import StageProgress
from automos.core.scan import Scan, Sequence
from automos.simulation import SCENARIOS, Conditions, Convention, record, write_recorded
from automos.simulation.recorders import Recorded


@dataclass(frozen=True)
class Case:
    """A recorder and its surroundings, and the case that its cost is measured against.

    Attributes
    ----------
    convention, conditions : how points are kept; what carries the sensor, and the weather.
    n_lidars, knows_mounts : how many LiDARs there are, and whether the recorder says whose each point is.
    is_cut_free : whether the points on what carries the sensor are left out.
    against : name of the case that has the same drive without what this one is about.
    """

    convention: Convention = field(default_factory=Convention)
    conditions: Conditions = field(default_factory=Conditions)
    n_lidars: int = 1
    knows_mounts: bool = False
    is_cut_free: bool = False
    against: str = "plain"


def _kept(**about: object) -> Case:
    return Case(Convention(**about))  # type: ignore[arg-type]


def _made(**about: object) -> Case:
    return Case(conditions=Conditions(**about))  # type: ignore[arg-type]


def _carried(rig: str) -> dict[str, Case]:
    """Return the case of a carrier, and that of the same drive with the points on the carrier left out.

    A carrier moves in its own way, and whoever would pass through it is gone: it is another drive than the plain one.
    """
    conditions, cut_free = Conditions(rig=rig), f"{rig}, its points left out"
    return {
        cut_free: Case(conditions=conditions, is_cut_free=True),
        rig: Case(conditions=conditions, against=cut_free),
    }


CASES: dict[str, Case] = {
    "plain": Case(),
    "in time order": _kept(order="time"),
    "beam by beam": _kept(order="ring"),
    "shuffled": _kept(order="random"),
    "cut every 0.8 turns": _kept(turns=0.8, order="time"),
    "cut every 0.92 turns": _kept(turns=0.92, order="time"),
    "cut every 1.09 turns": _kept(turns=1.09, order="time"),
    "cut every 1.2 turns": _kept(turns=1.2, order="time"),
    "cut every 1.09 turns, no stamps": _kept(turns=1.09, order="time", stamps=False),
    "cut every 1.09 turns, beam by beam": _kept(turns=1.09, order="ring"),
    "cut every 0.92 turns, shuffled": _kept(turns=0.92, order="random"),
    "cut every 1.09 turns, shuffled": _kept(turns=1.09, order="random"),
    "cut every 1.2 turns, shuffled": _kept(turns=1.2, order="random"),
    "cut every 1.09 turns, relative times": _kept(turns=1.09, order="time", times="relative"),
    "cut every 1.09 turns, shuffled, relative times": _kept(turns=1.09, order="random", times="relative"),
    "cut every 1.09 turns, absolute times, no stamps": _kept(turns=1.09, order="time", times="absolute", stamps=False),
    "relative times": _kept(times="relative"),
    "absolute times": _kept(times="absolute"),
    "times in milliseconds": _kept(times="milliseconds"),
    "times that run backwards": _kept(times="backwards"),
    "times all the same": _kept(times="constant"),
    "times that are no numbers": _kept(times="nan"),
    "times twice too long": _kept(times="too long"),
    "compensated to the start": _kept(reference="start"),
    "compensated to the middle": _kept(reference="middle"),
    "compensated to the end": _kept(reference="end"),
    "compensated to the middle, times kept": _kept(reference="middle", times="relative"),
    "compensated by 90 % of the speed": _kept(reference="middle", reference_speed=0.9),
    "2 % of the packets lost": _kept(lost_packets=0.02),
    "every 7th scan lost": _kept(leave_out=7),
    "every 7th scan lost, no stamps": _kept(leave_out=7, stamps=False),
    "every 10th scan twice": _kept(double=10),
    "every 10th scan twice, no stamps": _kept(double=10, stamps=False),
    "renumbered": _kept(renumbered=True),
    "renumbered, no stamps": _kept(renumbered=True, stamps=False),
    "renumbered, absolute times, no stamps": _kept(renumbered=True, times="absolute", stamps=False),
    "two scans merged": _kept(turns=2.0),
    "every 2nd scan kept": _kept(every=2),
    "every 2nd scan kept, no stamps": _kept(every=2, stamps=False),
    "coordinates in centimetres": _kept(unit=0.01),
    "coordinates rounded to 2 cm": _kept(rounding=0.02),
    "every 4th beam": _kept(beams=4),
    "front 120 degrees": _kept(field_of_view=120.0),
    "a sector of 60 degrees lost": _kept(lost_sector=60.0),
    "1 % specks in the air": _kept(specks=0.01),
    "two LiDARs": Case(n_lidars=2),
    "two LiDARs, mounts known": Case(n_lidars=2, knows_mounts=True),
    "three LiDARs": Case(n_lidars=3),
    "three LiDARs, mounts known": Case(n_lidars=3, knows_mounts=True),
    **_carried("boat"),
    **_carried("truck"),
    **_carried("backpack"),
    "rain": _made(weather="rain"),
    "dust": _made(weather="dust"),
    "blooming": _made(blooming=True),
}
"""All conventions by name."""

OF_DRIVE = (
    "in time order",
    "cut every 1.09 turns",
    "cut every 0.92 turns",
    "cut every 1.09 turns, no stamps",
    "cut every 1.09 turns, relative times",
    "cut every 1.09 turns, shuffled",
    "every 7th scan lost, no stamps",
    "every 10th scan twice, no stamps",
    "renumbered, no stamps",
    "two scans merged",
    "beam by beam",
    "shuffled",
)
"""Those that a real recording of raw sweeps is put through, too."""

ALLOWED, ALLOWED_HALVED = 1.0, 3.0
"""Points of IoU that a convention may cost on average; where half of the scans are merged or lost."""
REFERENCES = {case.against for case in CASES.values()}
"""What the others are measured against."""
HALVED = ("two scans merged", "every 2nd scan kept", "every 2nd scan kept, no stamps")


class InMemory:
    """Sweeps that are cast once and kept, for many recorders to cut; without the points on the carrier, if asked."""

    def __init__(self, inner, is_cut_free: bool = False):  # type: ignore[no-untyped-def]
        self._inner, self.name, self.period, self.stamps = inner, inner.name, inner.period, inner.stamps
        self.poses_at = inner.poses_at
        kept = [~inner.own_body(k) if is_cut_free else slice(None) for k in range(len(inner))]
        self._scans: list[Scan] = [_part(inner[k], rows) for k, rows in enumerate(kept)]
        self._truth = [inner.truth(k)[rows] for k, rows in enumerate(kept)]

    def __len__(self) -> int:
        return len(self._scans)

    def __getitem__(self, index: int) -> Scan:
        return self._scans[index]

    def truth(self, index: int) -> npt.NDArray[np.uint32]:
        return self._truth[index]

    def own_body(self, index: int) -> npt.NDArray[np.bool_]:
        """Return (N,) which points of sweep `index` are on what carries the sensor."""
        return self._inner.own_body(index)


def _part(scan: Scan, rows: npt.NDArray[np.bool_] | slice) -> Scan:
    columns = ("points", "intensity", "time", "ring", "sensor")
    part = {name: getattr(scan, name)[rows] for name in columns if getattr(scan, name) is not None}
    return replace(scan, **part)


@lru_cache(maxsize=1)
def sweeps(scenario: str, sensor: str, n_scans: int, seed: int, case: Case) -> InMemory:
    """Return the sweeps of a drive; those of the last one asked for are remembered."""
    made = record(scenario, sensor, n_scans, seed, conditions=case.conditions, n_lidars=case.n_lidars)
    return InMemory(made.turns, case.is_cut_free)


def drive_of(case: Case) -> Case:
    """Return the case of the same sweeps, kept plainly."""
    return Case(conditions=case.conditions, n_lidars=case.n_lidars, is_cut_free=case.is_cut_free)


def measured(case: Case, asked: tuple[str, str, int, int], name: str, scores: Scores) -> dict:
    """Return the row of one drive, kept by one convention."""
    with tempfile.TemporaryDirectory() as folder:

        def written(_: StageProgress) -> Sequence:
            turns = sweeps(*asked, drive_of(case))
            recorded = Recorded(turns, case.convention, asked[3])
            if case.knows_mounts:  # files of this layout cannot say
                return recorded
            return open_sequence(write_recorded(recorded, Path(folder) / "recording"))

        def bodies(index: int) -> npt.NDArray[np.bool_]:
            return sweeps(*asked, drive_of(case)).own_body(index)

        has_bodies = case.convention == Convention() and not case.is_cut_free
        return scores.of(name, written, bodies if has_bodies else None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--conventions", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--scenarios", nargs="+", choices=SCENARIOS, default=["city", "junction", "avenue", "campus"])
    parser.add_argument("--sensors", nargs="+", default=["HDL-64E", "OS1-128", "VLP-16"])
    parser.add_argument("--scans", type=int, default=40)
    parser.add_argument("--seed", type=int, default=17)
    parser.add_argument("--preset", default="default")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--json", type=Path, help="the table, for the docs")
    arguments = parser.parse_args()
    scores = Scores(arguments.store, arguments.preset, arguments.workers)
    names = list(dict.fromkeys(["plain", *(n for c in arguments.conventions for n in (CASES[c].against, c))]))
    rows: dict[tuple[str, str, str], dict] = {}
    # Cases of the same sweeps follow each other: a drive is cast once for all that its recorders do.
    for scenario in arguments.scenarios:
        for sensor in arguments.sensors:
            asked = (scenario, sensor, arguments.scans, arguments.seed)
            for name in sorted(names, key=lambda n: str(drive_of(CASES[n]))):
                cell = f"{scenario}-{sensor}-{arguments.scans}-{arguments.seed}-{name}"
                rows[name, scenario, sensor] = measured(CASES[name], asked, cell, scores)
    table = tabulate(rows, names, arguments.scenarios, arguments.sensors)
    title = "IoU % as it is; points that each convention costs (means over the scenarios)"
    show_lines(table, arguments.json, title)


def tabulate(rows: dict, names: list[str], scenarios: list[str], sensors: list[str]) -> list[list[str]]:
    """Return heading and lines: name, cost by sensor, mean cost, worst cell, shares of body and air called moving."""
    lines = [["", *sensors, "mean", "worst cell", "body moving", "air moving"]]
    for name in names:
        costs = {
            (scenario, sensor): _cost(rows[name, scenario, sensor], rows[CASES[name].against, scenario, sensor], name)
            for scenario in scenarios
            for sensor in sensors
        }
        refused = [key for key in costs if "refused" in rows[(name, *key)]]
        if refused:
            reason = rows[(name, *refused[0])]["refused"]
            lines.append([name, *[""] * len(sensors), "refused", reason[:60], "", ""])
            continue
        by_sensor = [np.nanmean([costs[c, s] for c in scenarios]) for s in sensors]
        mean = float(np.nanmean(list(costs.values())))
        worst = max(costs, key=lambda key: np.nan_to_num(costs[key], nan=-np.inf))
        allowed = ALLOWED_HALVED if name in HALVED else ALLOWED
        mark = "" if name in REFERENCES or mean <= allowed else " !"
        of_worst = "" if name in REFERENCES else f"{costs[worst]:+.1f} {worst[0]} {worst[1]}"
        shares = [_share([rows[name, c, s] for c in scenarios for s in sensors], part) for part in ("body", "air")]
        lines.append([name, *(f"{value:.1f}" for value in by_sensor), f"{mean:.1f}{mark}", of_worst, *shares])
    return lines


def _cost(row: dict, plain: dict, name: str) -> float:
    """Return the points that are lost; of what others are measured against, its IoU in percent."""
    if "refused" in row:
        return float("nan")
    return 100.0 * row["iou"] if name in REFERENCES else 100.0 * (plain["iou"] - row["iou"])


def _share(rows: list[dict], part: str) -> str:
    """Return the share of the points on a `part` of the recordings (body, air) that are called moving."""
    points = sum(row[f"{part}_points"] for row in rows)
    return f"{100.0 * sum(row[f'{part}_moving'] for row in rows) / points:.3f} %" if points else ""


if __name__ == "__main__":
    main()
