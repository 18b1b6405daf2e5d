"""The method as scans come, at any lag: quality of every scan, of the first ones, and how soon departures are seen.

Truth at a lag is what moves now, of simulated worlds and of recordings with labels_now/; else, and of whole recordings,
what moves at some time. A *departure* is a mover that stood in plain view for a second; what counts are the metres
along its path, of the boxes beside the scans, from the first scan in which it moves to the first in which half of its
points are called moving.
"""

import json
import math
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from labels import scores_of
from recordings import StoredWorld, opened

from automos import Labeler, LabelledScan
from automos.core.labels import Label
from automos.core.scan import Sequence
from automos.evaluation.moving import Counts, count
from automos.live.segment import stamped

FIRST = 10
"""Scans of a start."""
PLAIN = 30
"""Points that an object in plain view has."""
STOOD = 1.0
"""Seconds for which it stood."""


def score(recording: str, store: Path, lag: float | str) -> dict[str, Any]:
    """Return points right and wrong, those of the start, departures, and processor milliseconds a scan at a `lag`.

    lag : seconds, or "all" for the whole recording.
    """
    with opened(recording, store) as made:
        sequence = made.sequence
        labeler = Labeler(lag=float("inf" if lag == "all" else lag), is_compensated=sequence.is_compensated)
        whole, start, cpu = Counts(), Counts(), time.process_time()
        seen = _Seen(sequence, is_whole=lag == "all")
        for scan in stamped(sequence):
            for done in labeler.push(scan):
                whole, start = seen.counted(done, whole, start)
        for done in labeler.finish():
            whole, start = seen.counted(done, whole, start)
        cpu = 1e3 * (time.process_time() - cpu) / len(sequence)
    of_start = {f"start_{name}": value for name, value in scores_of(start).items()}
    return scores_of(whole) | of_start | {"departures": seen.departures(), "cpu_ms": cpu, "scans": len(sequence)}


class _Seen:
    """What was called moving of each object, scan by scan."""

    def __init__(self, sequence: Sequence, is_whole: bool):
        self._sequence, self._folder, self._is_whole = sequence, getattr(sequence, "source", Path()), is_whole
        self._of: dict[int, list[tuple[float, int, bool, float, npt.NDArray[np.float64]]]] = defaultdict(list)

    def counted(self, done: LabelledScan, whole: Counts, start: Counts) -> tuple[Counts, Counts]:
        """Return the counts with those of the next scan, the second for the start alone."""
        truth = self._sequence.truth(done.index)
        if truth is None:
            return whole, start
        now = self._now(done.index, truth)
        self._add(done, now)
        found = count(done.labels, truth if self._is_whole else now)
        return whole + found, start + found if done.index < FIRST else start

    def _now(self, index: int, truth: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
        if isinstance(self._sequence, StoredWorld):
            return self._sequence.truth_now(index)
        file = self._folder / "labels_now" / f"{self._sequence.names[index]}.label"
        return np.fromfile(file, np.uint32) if file.exists() else truth

    def _add(self, done: LabelledScan, truth: npt.NDArray[np.uint32]) -> None:
        for k, place in self._places(done).items():
            of = truth >> 16 == k
            moves = truth[of] & 0xFFFF == Label.MOVING
            if of.any():
                called = float(np.mean(done.labels[of] == Label.MOVING))
                self._of[k].append((done.stamp, len(moves), bool(moves.mean() > 0.5), called, place))

    def _places(self, done: LabelledScan) -> dict[int, npt.NDArray[np.float64]]:
        """Return the middle of each object's box, in a frame that stands: boxes/NAME.json, or boxes.json of sensors."""
        if isinstance(self._sequence, StoredWorld):
            of_world = self._sequence.truth_boxes(done.index)
            return dict(zip(of_world.ids.tolist(), of_world.boxes.center, strict=True))
        one, all_of_them = self._folder / "boxes" / f"{self._sequence.names[done.index]}.json", "boxes.json"
        if one.exists():
            return {row["id"]: np.array(row["center"]) for row in json.loads(one.read_text())["boxes"]}
        if (self._folder / all_of_them).exists():
            rows = json.loads((self._folder / all_of_them).read_text())[done.index]
            return {row["id"] + 1: (done.pose @ [row["x"], row["y"], row["z"], 1.0])[:3] for row in rows}
        return {}

    def departures(self) -> list[dict[str, float]]:
        """Return object, seconds, points and metres until each is called moving; nan of one that never is."""
        return [found for k, seen in self._of.items() if (found := _departure(k, *zip(*seen, strict=True))) is not None]


def _departure(k: int, stamps: Any, points: Any, moves: Any, called: Any, places: Any) -> dict[str, float] | None:
    times, n_points, is_moving = np.array(stamps), np.array(points), np.array(moves)
    for t in np.flatnonzero(is_moving[1:] & ~is_moving[:-1]) + 1:
        before = (times >= times[t] - STOOD - 0.5 * (times[t] - times[t - 1])) & (times < times[t])
        is_plain = before.any() and n_points[before].min() >= PLAIN
        if times[t] - times[0] < STOOD or is_moving[before].any() or not is_plain:
            continue
        way = np.cumsum([0.0, *np.linalg.norm(np.diff(np.array(places[t:]), axis=0), axis=1)])
        late = np.flatnonzero(np.array(called[t:]) >= 0.5)
        metres = float(way[late[0]]) if len(late) else math.nan
        return {"object": k, "at": float(times[t]), "points": int(n_points[t]), "metres": metres}
    return None
