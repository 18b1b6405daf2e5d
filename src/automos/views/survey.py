"""One walk through a run and its recording that gathers all a report shows, ready to be written as JSON."""

import base64
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.geometry import transform
from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.core.reading import damage_reported, is_there, read_text
from automos.core.workspace import Workspace
from automos.evaluation.moving import Counts, Scores, count, ranges_of
from automos.evaluation.objects import FOUND, movers_of
from automos.evaluation.overlaps import Overlaps, count_overlaps
from automos.results.run_files import RunFiles
from automos.views.caveats import caveats, trust_in
from automos.views.ground_map import GroundMap, Thumbnails
from automos.views.topdown import verdicts

MAX_THUMBNAILS = 900
"""Tracks that get a picture; the least certain and all that moves go first."""
MAX_BOXES = 40_000
"""Boxes of moving tracks that the map can play back; of more, every second scan is kept, or every third."""


def survey(run: RunFiles) -> dict[str, Any]:
    """Return the data of a report on `run`: plain numbers, texts and packed arrays.

    Raises
    ------
    InputError
        Label files or poses that are missing or damaged.
    """
    about = Workspace(run.folder).read_run()
    n = len(run)
    told = [(doubt(track), track_row(track), _moving_boxes(track)) for track in run.each_track()]
    T_level_sensor = np.array([run.T_level_sensor(i) for i in range(n)])
    path = T_level_sensor[:, :3, 3]
    boxes = _packed_boxes(np.concatenate([np.zeros((0, 7), np.float32), *(of_track for _, _, of_track in told)]), n)
    rows = [row for _, row, _ in sorted(told, key=lambda one: one[0])]
    del told
    drawn = {row["id"] for row in sorted(rows, key=lambda row: row["verdict"] == "static")[:MAX_THUMBNAILS]}
    ground, pictures = GroundMap(path), Thumbnails(track for track in run.each_track() if track["id"] in drawn)
    points, sure, truth = np.zeros((n, len(Label)), np.int64), _Sureness(rows), _Truth(run)
    for i in run.each("report"):
        scan = run.scan(i)
        packed = run.packed(i, len(scan))
        labels = to_mos(packed)
        points[i] = [(labels == label).sum() for label in Label]
        level = transform(T_level_sensor[i], run.points_at_pose(scan, i))
        is_shown = scan.is_valid & (labels != Label.UNLABELED)
        owners = run.stored.tracks(run.names[i], packed)
        sure.add(labels, owners)
        kinds = truth.compare(i, labels, scan.points, owners)
        ground.add(level[is_shown], kinds[is_shown])
        pictures.add(i, level[scan.is_valid])
    warnings = caveats(about, rows, T_level_sensor, run.stamps, run.names, points.sum(axis=0))
    scores = truth.to_page()
    return {
        "name": about.get("recording", {}).get("name", run.sequence.name),
        "scans": n,
        "names": run.names,
        "stamps": np.round(run.stamps - run.stamps[0], 3).tolist() if n else [],
        "has_clock": run.sequence.stamps is not None,
        "points": points.T.tolist(),  # one list per class
        "path": path[:, :2].round(2).tolist(),
        "height": path[:, 2].round(3).tolist(),
        "tilt": T_level_sensor[:, 2, 2].clip(-1.0, 1.0).round(5).tolist(),  # cosine of the angle to up
        "heading": np.arctan2(T_level_sensor[:, 1, 0], T_level_sensor[:, 0, 0]).round(3).tolist(),
        "length": round(float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()), 1),
        "map": ground.to_page(),
        "tracks": rows,
        "pictures": pictures.to_page(),
        "boxes": boxes,
        "truth": scores,
        "trust": trust_in(about, warnings, sure.expected, None if scores is None else scores["all"]),
        "caveats": warnings,
        "warnings": [_pointed(warning, run.names) for warning in about.get("warnings", []) if "scan" in warning],
        "run": {key: about.get(key, {}) for key in ("seconds", "versions", "odometry", "review", "quality")},
        "settings": _settings_text(run),
    }


def doubt(track: dict[str, Any]) -> tuple[float, int]:
    """Return the sort key of a track: the least certain first, then the longest."""
    return track["confidence"], -len(track["boxes"])


def track_row(track: dict[str, Any]) -> dict[str, Any]:
    """Return the table row of a track of tracks.json."""
    seen = [box for box in track["boxes"] if box["observed"]] or track["boxes"]
    centers = np.array([box["center"] for box in seen])
    speeds = np.array([np.hypot(*box["velocity"][:2]) for box in seen])
    row = {
        "id": track["id"],
        "verdict": track["verdict"],
        "confidence": track["confidence"],
        "first": track["boxes"][0]["scan"],
        "last": track["boxes"][-1]["scan"],
        "seen": len(seen),
        "size": np.max([box["size"] for box in seen], axis=0).round(1).tolist(),
        "moved": round(float(np.linalg.norm(centers[-1] - centers[0])), 1),
        "speed": round(float(np.median(speeds)), 1) if track["verdict"] == "moving" else 0.0,
        "at": centers[len(centers) // 2, :2].round(1).tolist(),
    }
    return {**row, "reviewed": True} if "found" in track else row


def _moving_boxes(track: dict[str, Any]) -> npt.NDArray[np.float32]:
    """Return (K, 7) float32 scan, track, x, y, length, width, yaw of each box, of a track that moves."""
    boxes = track["boxes"] if track["verdict"] == "moving" else []
    rows = [(box["scan"], track["id"], *box["center"][:2], *box["size"][:2], box["yaw"]) for box in boxes]
    return np.array(rows, np.float32).reshape(-1, 7)


def _packed_boxes(rows: npt.NDArray[np.float32], n_scans: int) -> dict[str, Any]:
    """Return the rows (K, 7) of `_moving_boxes` by scan, as base64; too many are thinned out by scans."""
    step = 1 + len(rows) // MAX_BOXES
    rows = rows[rows[:, 0].astype(int) % step == 0]
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
    starts = np.searchsorted(rows[:, 0], np.arange(n_scans + 1))
    return {"step": step, "starts": starts.tolist(), "rows": base64.b64encode(rows.tobytes()).decode()}


def _pointed(warning: dict[str, Any], names: list[str]) -> dict[str, Any]:
    """Return a warning of run.json as the page shows it: with the number of the scan that it points at, if any."""
    shown: dict[str, Any] = {key: warning[key] for key in ("sentence", "track", "at") if key in warning}
    scan = warning.get("scan")
    return {**shown, "scan": names.index(scan)} if scan in names else shown


def _settings_text(run: RunFiles) -> str:
    path = run.folder / "settings.yaml"
    with damage_reported(path):
        return read_text(path) if is_there(path) else ""


class _Sureness:
    """How many of the moving points are right, by the confidence of the objects that they are on."""

    def __init__(self, rows: list[dict[str, Any]]):
        self._sure = {row["id"]: row["confidence"] for row in rows}
        self._points, self._right = 0, 0.0

    def add(self, labels: npt.NDArray, owners: npt.NDArray | None) -> None:
        """Count the moving points of a scan that are on an object: `labels` and `owners` (N,)."""
        if owners is not None:
            ids, counts = np.unique(owners[(labels == Label.MOVING) & (owners > 0)], return_counts=True)
            for track, n in zip(ids.tolist(), counts.tolist(), strict=True):
                if track in self._sure:
                    self._points += n
                    self._right += self._sure[track] * n

    @property
    def expected(self) -> float | None:
        """Share that is right; None without any."""
        return self._right / self._points if self._points else None


class _Truth:
    """Counts against the ground truth, if there is any."""

    def __init__(self, run: RunFiles):
        self._sequence, self._counts = run.sequence, Counts()
        self._overlaps = [Overlaps.empty()]
        self._per_scan = np.full((len(run), 3), -1, np.int64)

    def compare(self, index: int, labels: npt.NDArray, points: npt.NDArray, owners: npt.NDArray | None) -> npt.NDArray:
        """Count the labels of a scan against its ground truth; return what the map draws for each point."""
        truth = self._sequence.truth(index)
        if truth is None:
            return verdicts(labels, None)
        counted = count(labels, truth, ranges_of(points))
        scores = counted.scores
        self._per_scan[index] = scores.true_dynamic, scores.false_dynamic, scores.false_static
        self._counts += counted
        self._overlaps.append(count_overlaps(index, labels, truth, owners))
        return verdicts(labels, truth)

    def to_page(self) -> dict[str, Any] | None:
        if not self._counts.n_scans:
            return None
        recall = movers_of(Overlaps.concatenate(self._overlaps)).recall
        return {
            "all": _scores(self._counts.scores),
            "ranges": {name: _scores(scores) for name, scores in self._counts.scores_by_range.items()},
            "scans": self._per_scan.tolist(),  # true, false, missed moving points; -1 where there is no truth
            "objects": len(recall),
            "found": int((recall >= FOUND).sum()),
            "n_scans": self._counts.n_scans,
            "untold": int(self._counts.confusion[:, Label.UNLABELED].sum()),  # points without truth in these scans
        }


def _scores(scores: Scores) -> dict[str, float | int | None]:
    found = {name: round(value, 5) if np.isfinite(value) else None for name, value in scores.ratios.items()}
    return {**found, "td": scores.true_dynamic, "fd": scores.false_dynamic, "fs": scores.false_static}
