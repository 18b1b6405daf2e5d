"""Objects made by a person: a way that was pointed at through time; and what is cut, split or joined of found ones.

Points that already belong to a moving object stay with it: where the path of the new object enters a moving one, it
ends. Decisions change which these are and nothing else, so the way is found once, and what is free is asked anew.
"""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.objects.boxes import fit_boxes
from automos.objects.verdict import Verdict
from automos.review.amendments import Amendment, Part
from automos.review.box_rows import as_rows, is_inside
from automos.review.log import now
from automos.review.run_stages import Changes, Rows, RunStages, changed_labels, decided_verdicts, number_of

MIN_OWN = 0.5
"""Share of its points that must not move with something else already."""
OnScan = Callable[[int], None]
"""Told of every scan that is looked at: of how many points are sought in, 0 while the way is; may raise to end it."""
Found = tuple[Rows, npt.NDArray[np.int64]]


@dataclass(frozen=True, eq=False)
class Way:
    """Something that a person pointed at, through time, whatever was decided.

    Attributes
    ----------
    scans : list of lists of int
        Indices, from where it was pointed at on, one list in each direction.
    boxes : (7,) float64 by scan
        Centre, size, yaw; level frame.
    held : callable
        Of a scan, which is read once: the rows (K,) of its points there, and the track (K,) each belongs to, or -1.
    may_end : bool
        Whether it ends where it enters what moves with something else.
    """

    scans: list[list[int]]
    boxes: dict[int, npt.NDArray[np.float64]]
    held: Callable[[int], Found]
    may_end: bool


def proposed(stages: RunStages, way: Way, changes: Changes) -> Amendment:
    """Return what of `way` does not move with something else already, after `changes`.

    Raises
    ------
    InputError
        All of it does.
    """
    is_moving = np.append(decided_verdicts(stages.verdicts, changes.decided).verdict == Verdict.MOVING, False)
    parts = {}
    for scans in way.scans:
        for i in scans:
            found, owner = way.held(i)
            moves = is_moving[owner]  # owner -1 reads the last
            for one in changes.amendments:
                if stages.names[i] in one.parts:
                    moves[np.isin(found, one.parts[stages.names[i]].rows)] = one.verdict == "moving"
            free = found[~moves]
            if way.may_end and i != way.scans[0][0] and len(free) < MIN_OWN * len(found):
                break
            if len(free):
                parts[stages.names[i]] = Part.of_box(free, way.boxes[i], stages.T_level_sensor[i])
    if not parts:
        raise InputError("what stands there moves already: choose it in the list")
    return Amendment("", now(), "added", "moving", dict(sorted(parts.items())))


def as_amendment(stages: RunStages, track: int, changes: Changes) -> Amendment:
    """Return the object with index `track` (from 0) as if it were made by hand: all its points, scan by scan.

    Its points are those that are, or would be, painted if it moves.
    """
    made = next((one for one in changes.amendments if number_of(stages, one) == track), None)
    if made is not None:
        return made
    here = stages.tracks[stages.tracks.rows_of(track)]
    verdict = changes.decided.get(track, stages.verdict(track))
    painted = changes if verdict == "moving" else replace(changes, decided={**changes.decided, track: "moving"})
    parts = {}
    for i, box in zip(here.scan.tolist(), as_rows(here.boxes), strict=True):
        rows = np.flatnonzero(changed_labels(stages, i, painted)["track"] == track)
        if len(rows):
            parts[stages.names[i]] = Part.of_box(rows, box, stages.T_level_sensor[i])
    if not parts:
        raise InputError(f"object {track + 1} has no points of its own left")
    return Amendment("", now(), "cut", verdict, parts)


def cut(stages: RunStages, one: Amendment, index: int) -> list[Amendment]:
    """Return `one` before scan `index`, and from it on.

    Raises
    ------
    InputError
        One of the two would be nothing.
    """
    before = {name: part for name, part in one.parts.items() if stages.index[name] < index}
    after = {name: part for name, part in one.parts.items() if stages.index[name] >= index}
    if not before or not after:
        raise InputError("it begins here: go to the first moment of the second half, and cut there")
    return [replace(one, key="", at=now(), how="cut", parts=parts) for parts in (before, after)]


def split(stages: RunStages, one: Amendment, index: int, box: npt.NDArray[np.float64]) -> list[Amendment]:
    """Return what of `one` is in `box` (5,), drawn in scan `index`, and the rest.

    The box is carried along with the object: in every scan it is where it was drawn beside, and turned against, the
    object's own box. Level frame; x, y, length, width, yaw.

    Raises
    ------
    InputError
        All of it or nothing of it is in the box.
    """
    T = stages.T_level_sensor
    if stages.names[index] not in one.parts:
        raise InputError("it is not in this scan: go to one in which it is, and draw the box there")
    at = one.parts[stages.names[index]].box_level(T[index])
    halves: tuple[dict[str, Part], dict[str, Part]] = ({}, {})
    for name, part in one.parts.items():
        i = stages.index[name]
        own = part.box_level(T[i])
        # A box that is fitted anew may be turned by quarters; the object is not.
        turn = (own[6] - at[6] + 0.25 * np.pi) % (0.5 * np.pi) - 0.25 * np.pi
        c, s = np.cos(turn), np.sin(turn)
        center = own[:2] + np.array([[c, -s], [s, c]]) @ (box[:2] - at[:2])
        drawn = np.array([*center, 0.0, box[2], box[3], 2e3, box[4] + turn])
        inside = is_inside(stages.points_level(i, part.rows), drawn)
        for half, mask in zip(halves, (inside, ~inside), strict=True):
            if mask.any():
                half[name] = _fitted(stages, i, part.rows[mask])
    if not all(halves):
        raise InputError("the box must hold a part of the object, and leave a part: draw it again")
    return [replace(one, key="", at=now(), how="split", parts=parts) for parts in halves]


def join(stages: RunStages, several: list[Amendment]) -> Amendment:
    """Return one object that is all of `several`; its verdict is that of the first."""
    parts: dict[str, list[Part]] = defaultdict(list)
    for one in several:
        for name, part in one.parts.items():
            parts[name].append(part)
    joined = {}
    for name, these in sorted(parts.items(), key=lambda item: stages.index[item[0]]):
        rows = np.unique(np.concatenate([part.rows for part in these]))
        joined[name] = these[0] if len(these) == 1 else _fitted(stages, stages.index[name], rows)
    return replace(several[0], key="", at=now(), how="joined", parts=joined)


def _fitted(stages: RunStages, index: int, rows: Rows) -> Part:
    """Return the part of the points `rows` (K,) of scan `index`, in the box that fits them."""
    points = stages.points_level(index, rows)
    found = fit_boxes(points, np.zeros(len(points), np.int32), np.ones(1))
    return Part.of_box(rows, as_rows(found)[0], stages.T_level_sensor[index])
