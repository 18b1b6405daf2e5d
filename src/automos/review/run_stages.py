"""The stage results of a run, read back to label scans again after a decision; and the labels of a scan after it.

A decision replaces the verdict of a track: the labels are what the pipeline would have written with this verdict. An
object made by a person takes its points from any other object.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.labels import Label
from automos.core.scan import Frame, Sequence
from automos.core.stages import Stage
from automos.core.workspace import Workspace, require_same
from automos.objects.detections import Detections
from automos.objects.labels import label_scans
from automos.objects.tracking import Scans, TrackedObjects
from automos.objects.verdict import Verdict, Verdicts
from automos.odometry.trajectory import SequenceFrames, Trajectory
from automos.review.amendments import Amendment
from automos.settings import load_settings

Rows = npt.NDArray[np.int64]
"""Of the points of a scan as the recording has it, or of a frame."""
CACHED = 40
"""Frames kept in memory, 2 MB each, so that looking at neighbours of a track reads no scan twice."""

CACHED_BITS = 4000
"""Scans of which is kept which points are valid, 15 kB each: a decision names rows without reading any scan twice."""


class RunStages:
    """The results of all stages in a results folder, with the recording they were made from.

    T_level_sensor : (N, 4, 4) where the sensor was at each scan.
    """

    def __init__(self, folder: Path, sequence: Sequence):
        """Take the folder and the recording.

        Raises
        ------
        InputError
            The folder holds no stages of this recording.
        """
        self.folder = folder
        self.names = sequence.names
        self.index = {name: i for i, name in enumerate(self.names)}
        self.keys: dict[str, str] = Workspace(folder).read_run().get("stages", {})
        for name in ("odometry", "candidates", "instances", "tracking", "labels"):
            if not (folder / "stages" / f"{name}-{self.keys.get(name)}").is_dir():
                raise InputError(
                    f"{folder} does not hold what stage {name} found, without which nothing can be decided; run "
                    f"automos label again with --out {folder} (decisions made so far are kept)"
                )
        self.settings = load_settings("default", folder / "settings.yaml")
        self.trajectory = Trajectory.from_arrays(self.stage("odometry").load("all"))
        if len(self.trajectory) != len(sequence):
            raise InputError(
                f"{folder} is of {len(self.trajectory)} scans, but {sequence.name} has {len(sequence)}; give the "
                "recording it was made from"
            )
        self.T_level_sensor = self.trajectory.T_level_sensor
        self.objects = TrackedObjects.from_arrays(self.stage("tracking").load("all"))
        self.tracks, self.verdicts = self.objects.tracks, self.objects.verdicts
        self.frames = _CachedFrames(self, sequence)
        self._validity = lru_cache(CACHED_BITS)(self._read_validity)

    def painted(self, index: int, objects: TrackedObjects) -> dict[str, npt.NDArray]:
        """Return label, track and confidence (N,) of scan `index` as the pipeline writes them of these `objects`."""
        scans = Scans(self.frames, self.names, self.stage("candidates"), self.stage("instances"))
        ((_, per_point),) = label_scans(scans, objects, self.settings, 1, [index])
        return dict(per_point)

    def stage(self, name: str) -> Stage:
        """Return the results of one stage."""
        return Workspace(self.folder).stage(name, self.keys[name])

    def detections(self, index: int) -> Detections:
        """Return the segments of scan `index`."""
        return Detections.from_arrays(self.stage("instances").load(self.names[index], *Detections.columns()))

    def kinds(self, index: int) -> npt.NDArray[np.uint8]:
        """Return (M,) what each point of frame `index` is: GROUND, OBJECT and so on."""
        return self.stage("candidates").load(self.names[index], "kind")["kind"]

    def segments(self, index: int) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        """Return (M,) the segment of each point of frame `index`, and (M,) the one that has stayed; -1 for none."""
        found = self.stage("instances").load(self.names[index], "ids", "stayed")
        return found["ids"], found["stayed"]

    def frame(self, index: int) -> Frame:
        """Return frame `index`."""
        return self.frames[index]

    def points_level(self, index: int, rows: npt.ArrayLike) -> npt.NDArray:
        """Return (K, 3) the points of scan `index`, as the recording has it, that are its `rows`; level frame."""
        frame = self.frame(index)
        return frame.points_level[np.searchsorted(frame.kept, rows)]

    def verdict(self, track: int) -> str:
        """Return what the pipeline found of `track` (index, from 0): "moving", "static" or "unknown"."""
        return Verdict(self.verdicts.verdict[track]).name.lower()

    def track_of_points(self, index: int) -> npt.NDArray[np.int64]:
        """Return (M,) for each point of frame `index` the track whose segment it is in, -1 for none."""
        ids, stayed = self.segments(index)
        segment = np.where(ids >= 0, ids, stayed)
        rows = self.tracks.rows_in_scan(index)
        owned = self.tracks.segment[rows]
        track = np.full(max(segment.max(initial=-1), owned.max(initial=-1)) + 2, -1)
        track[owned] = self.tracks.track[rows]
        track[-1] = -1  # of points without a segment, and tracks that were missed here
        return track[segment]

    def kept(self, index: int) -> Rows:
        """Return (M,) the rows of scan `index`, as the recording has it, that its frame's points are in."""
        packed, n_points = self._validity(index)
        return np.flatnonzero(np.unpackbits(packed, count=n_points))

    def _read_validity(self, index: int) -> tuple[npt.NDArray[np.uint8], int]:
        is_valid = self.frames.sequence[index].is_valid
        return np.packbits(is_valid), len(is_valid)

    def owner_of_points(self, index: int) -> npt.NDArray[np.int64]:
        """Return (N,) for each point of scan `index` the track it is painted as, or in whose segment it is, else -1."""
        owner = self.labels(index)["track"].astype(np.int64)
        kept, by_segment = self.kept(index), self.track_of_points(index)
        owner[kept] = np.where(owner[kept] >= 0, owner[kept], by_segment)
        return owner

    def labels(self, index: int) -> dict[str, npt.NDArray]:
        """Return label, track and confidence (N,) of each point of scan `index`, as the pipeline found them."""
        return self.stage("labels").load(self.names[index])


class _CachedFrames(SequenceFrames):
    """Frames with a cache of the last ones; InputError for a scan that has changed."""

    def __init__(self, stages: RunStages, sequence: Sequence):
        super().__init__(sequence, stages.trajectory)
        self._stages, self._make = stages, lru_cache(CACHED)(self._made)

    def _made(self, index: int) -> Frame:
        frame = super().__getitem__(index)
        require_same(self._stages.names[index], len(frame.points), self._stages.kinds(index))
        return frame

    def __getitem__(self, index: int) -> Frame:
        return self._make(int(index))


_LABEL = {"moving": Label.MOVING, "static": Label.STATIC, "unknown": Label.UNLABELED}
TAKEN = 0.5
"""Share of a track's points in a scan from which an object made by hand replaces it there."""
DOUBTFUL, CERTAIN = 128, 255
"""Confidences, of 255."""


@dataclass(frozen=True)
class Changes:
    """The changes to a run by a person: verdicts by track (index, from 0), and objects made by hand."""

    decided: dict[int, str] = field(default_factory=dict)
    amendments: list[Amendment] = field(default_factory=list)


def scans_of(stages: RunStages, tracks: Iterable[int], amendments: Iterable[Amendment] = ()) -> list[int]:
    """Return the scans that `tracks` (indices, from 0) or `amendments` are in."""
    of_tracks = stages.tracks.scan[np.isin(stages.tracks.track, list(tracks))].tolist()
    of_amendments = [stages.index[name] for one in amendments for name in one.parts if name in stages.index]
    return sorted({*of_tracks, *of_amendments})


def changed_labels(stages: RunStages, index: int, changes: Changes) -> dict[str, npt.NDArray]:
    """Return label, track and confidence (N,) of scan `index` after `changes`."""
    per_point = decided_labels(stages, index, changes.decided)
    here = list(parts_in(stages, index, changes))
    if not here:
        return per_point
    label, track, confidence = (per_point[key].copy() for key in ("label", "track", "confidence"))
    freed = np.isin(track, replaced(stages, index, changes))
    label[freed], track[freed], confidence[freed] = Label.STATIC, -1, DOUBTFUL
    for amendment, rows in here:
        label[rows], confidence[rows] = _LABEL[amendment.verdict], CERTAIN
        track[rows] = number_of(stages, amendment) if amendment.verdict == "moving" else -1
    return {"label": label, "track": track, "confidence": confidence}


def decided_labels(stages: RunStages, index: int, decided: dict[int, str]) -> dict[str, npt.NDArray]:
    """Return label, track and confidence (N,) of scan `index` after `decided` (verdict by track index, from 0).

    Points of a track that is unsure are unlabeled: neither moving nor static may be learnt from them.
    """
    here = stages.tracks.track[stages.tracks.rows_in_scan(index)].tolist()
    is_new = any(not decided[track] == "static" == stages.verdict(track) for track in here if track in decided)
    if not is_new:
        return stages.labels(index)  # a static track that a person calls static paints nothing either way
    verdicts = decided_verdicts(stages.verdicts, decided)
    unsure = np.array([track for track, verdict in decided.items() if verdict == "unknown"], np.int64)
    verdicts.verdict[unsure] = Verdict.MOVING  # painted as if it moved, to learn which points it has
    per_point = stages.painted(index, replace(stages.objects, verdicts=verdicts))
    is_unsure = np.isin(per_point["track"], unsure)
    per_point["label"][is_unsure], per_point["track"][is_unsure] = Label.UNLABELED, -1
    return per_point


def replaced(stages: RunStages, index: int, changes: Changes) -> list[int]:
    """Return the tracks (indices) that objects made by hand replace in scan `index`: they hold most of their points."""
    rows = [rows for _, rows in parts_in(stages, index, changes)]
    if not rows:
        return []
    owner = stages.owner_of_points(index)
    of_all = np.bincount(owner[owner >= 0], minlength=len(stages.tracks))
    taken = owner[np.unique(np.concatenate(rows))]
    held = np.bincount(taken[taken >= 0], minlength=len(stages.tracks))
    return np.flatnonzero((held > TAKEN * of_all) & (of_all > 0)).tolist()


def number_of(stages: RunStages, amendment: Amendment) -> int:
    """Return the index of an object made by hand among the tracks: after all that were found."""
    return len(stages.tracks) + int(amendment.key[1:]) - 1


def parts_in(stages: RunStages, index: int, changes: Changes) -> Iterator[tuple[Amendment, Rows]]:
    """Yield the objects made by hand that are in scan `index`, each with its rows there."""
    name = stages.names[index]
    for amendment in changes.amendments:
        if name in amendment.parts:
            rows = amendment.parts[name].rows
            yield amendment, rows[rows < len(stages.labels(index)["label"])]


def decided_verdicts(found: Verdicts, decided: dict[int, str]) -> Verdicts:
    """Return the verdicts after `decided`; what a person decided is certain."""
    verdict, confidence = found.verdict.copy(), found.confidence.copy()
    for track, word in decided.items():
        verdict[track], confidence[track] = Verdict[word.upper()], 1.0
    return replace(found, verdict=verdict, confidence=confidence)
