"""What a person pointed at, through time, and what of it becomes an object.

Points that already belong to a moving object stay with it: where the path of the new object enters a moving one, it
ends. Decisions change which these are and nothing else, so the way is found once, and what is free is asked anew.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.objects.verdict import Verdict
from automos.review.amendments import Amendment, Part
from automos.review.changes import Changes, decided_verdicts
from automos.review.log import now
from automos.review.run_stages import RunStages

MIN_OWN = 0.5
"""Share of its points that must not move with something else already."""
OnScan = Callable[[int], None]
"""Told of every scan that is looked at: of how many points are sought in, 0 while the way is; may raise to end it."""
Found = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]


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
                parts[stages.names[i]] = Part.of_box(free, way.boxes[i], stages.trajectory.T_level_sensor[i])
    if not parts:
        raise InputError("what stands there moves already: choose it in the list")
    return Amendment("", now(), "added", "moving", dict(sorted(parts.items())))
