"""Free-space evidence among the scans of the last seconds."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_ask import SPAN_TOLERANCE, ask, partners_of
from automos.candidates.free_space_view import Seen, View
from automos.scan import Pose
from automos.settings import FreeSpaceSettings


@dataclass(eq=False)
class _Look:
    stamp: float
    is_far: bool
    seen: Seen


class EvidenceWindow:
    """Memory holds the scans that may still be asked: all of the last few seconds, some of those before."""

    def __init__(self, settings: FreeSpaceSettings):
        """Take how others are asked."""
        self._settings = settings
        self._looks: list[_Look] = []

    def __len__(self) -> int:
        return len(self._looks)

    def add(self, stamp: float, seen: Seen) -> None:
        """Remember what the scan at `stamp`, later than all others, saw."""
        step = self._settings.far_step
        is_far = not self._looks or np.floor(stamp / step) > np.floor(self._looks[-1].stamp / step)
        self._looks.append(_Look(stamp, is_far, seen))

    def renew(self, seen: dict[float, Seen], T_after_before: Pose) -> None:
        """Take over what some scans, by stamp, are now known to have seen, and move all by (4, 4) `T_after_before`."""
        for look in self._looks:
            known = seen.get(look.stamp, look.seen)
            look.seen = (known if len(look.seen.kind) else as_partner(known)).moved(T_after_before)

    def question(self, stamp: float, mine: Seen) -> Callable[[ThreadPoolExecutor | None], npt.NDArray[np.float32]]:
        """Return what asks all scans that are remembered now about the one at `stamp`, which saw `mine`.

        It takes threads to share the work, or None in one of these threads. Whenever it is called, it asks the same.
        """
        stamps = np.array([look.stamp for look in self._looks])
        is_far = np.array([look.is_far for look in self._looks], np.bool_)
        chosen = partners_of(stamp, stamps, is_far, self._settings)
        others = [self._looks[k].seen for k in chosen]
        return partial(ask, mine, others, stamps[chosen] - stamp, self._settings)

    def forget(self, stamp: float) -> None:
        """Drop what no scan at `stamp` or later asks; of scans before it only what they saw is kept."""
        reach = 1.0 + SPAN_TOLERANCE
        near, far = stamp - reach * self._settings.far_from, stamp - reach * max(self._settings.spans)
        self._looks = [look for look in self._looks if look.stamp >= (far if look.is_far else near)]
        for look in self._looks:
            if look.stamp < stamp and len(look.seen.kind):
                look.seen = as_partner(look.seen)


def as_partner(seen: Seen) -> Seen:
    """Return what others need: the images without the points."""
    nothing = np.zeros(0, np.uint8)
    return Seen(nothing, nothing.astype(np.float32), nothing, [_without_points(view) for view in seen.views])


def _without_points(view: View) -> View:
    nobody = np.zeros(0, np.bool_)
    return replace(view, rows=slice(0), is_object=nobody, is_supported=nobody, objects=np.zeros((3, 0), np.float32))
