"""What a person changed, and the labels of a scan after it.

A decision replaces the verdict of a track: the labels are what the pipeline would have written with this verdict. An
object made by a person takes its points from any other object.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label
from automos.objects.labels import label_scans
from automos.objects.verdict import Verdict, Verdicts
from automos.review.amendments import Amendment
from automos.review.run_stages import RunStages

_VERDICT = {"moving": Verdict.MOVING, "static": Verdict.STATIC, "unknown": Verdict.UNKNOWN}
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
    here = stages.tracks.track[stages.tracks.scan == index].tolist()
    if all(decided.get(track, "static") == "static" == stages.verdict(track) or track not in decided for track in here):
        return stages.labels(index)  # a static track that a person calls static paints nothing either way
    verdicts = decided_verdicts(stages.verdicts, decided)
    unsure = np.array([track for track, verdict in decided.items() if verdict == "unknown"], np.int64)
    verdicts.verdict[unsure] = Verdict.MOVING  # painted as if it moved, to learn which points it has
    objects = replace(stages.objects, verdicts=verdicts)
    painted = label_scans(stages.scans, objects, stages.settings, 1, [index])
    per_point = dict(next(iter(painted))[1])
    is_unsure = np.isin(per_point["track"], unsure)
    per_point["label"] = np.where(is_unsure, np.uint8(Label.UNLABELED), per_point["label"])
    per_point["track"] = np.where(is_unsure, np.int32(-1), per_point["track"])
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


def parts_in(stages: RunStages, index: int, changes: Changes) -> Iterator[tuple[Amendment, npt.NDArray[np.int64]]]:
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
        verdict[track], confidence[track] = _VERDICT[word], 1.0
    return replace(found, verdict=verdict, confidence=confidence)
