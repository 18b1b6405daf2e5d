"""What the scans of the last seconds saw, and what they say of each other's points."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from automos.candidates.free_space_ask import SPAN_TOLERANCE, Evidence, ask, partners_of
from automos.candidates.free_space_view import Lidar, Seen, View
from automos.settings import FreeSpaceSettings


@dataclass(eq=False)
class _Look:
    stamp: float
    is_far: bool
    seen: Seen


class EvidenceWindow:
    """Memory holds the scans that may still be asked: all of the last few seconds, some of those before."""

    def __init__(self, settings: FreeSpaceSettings, lidars: list[Lidar], pool: ThreadPoolExecutor):
        """Take how others are asked, what is learnt of each LiDAR, and threads to share the work."""
        self.lidars = lidars
        self._settings, self._pool = settings, pool
        self._looks: list[_Look] = []

    def __len__(self) -> int:
        return len(self._looks)

    def add(self, stamp: float, seen: Seen) -> None:
        """Remember what the scan at `stamp`, later than all others, saw."""
        step = self._settings.far_step
        is_far = not self._looks or np.floor(stamp / step) > np.floor(self._looks[-1].stamp / step)
        self._looks.append(_Look(stamp, is_far, seen))

    def replace(self, stamp: float, seen: Seen) -> None:
        """Take `seen` for what the scan at `stamp` saw, if it is remembered."""
        for look in self._looks:
            if look.stamp == stamp:
                look.seen = seen if len(look.seen.kind) else _as_partner(seen)

    def ask(self, stamp: float, mine: Seen, shared: bool = True) -> Evidence:
        """Return what all scans that are remembered say of the one at `stamp`, which saw `mine`.

        shared : whether threads share the work; False in one of these threads.
        """
        stamps = np.array([look.stamp for look in self._looks])
        is_far = np.array([look.is_far for look in self._looks], np.bool_)
        chosen = partners_of(stamp, stamps, is_far, self._settings)
        chosen = chosen[stamps[chosen] != stamp]
        others = [self._looks[k].seen for k in chosen]
        return ask(mine, others, stamps[chosen] - stamp, self.lidars, self._settings, self._pool if shared else None)

    def forget(self, stamp: float) -> None:
        """Drop what no scan at `stamp` or later asks; of scans before it only what they saw is kept."""
        reach = 1.0 + SPAN_TOLERANCE
        near, far = stamp - reach * self._settings.far_from, stamp - reach * max(self._settings.spans)
        self._looks = [look for look in self._looks if look.stamp >= (far if look.is_far else near)]
        for look in self._looks:
            if look.stamp < stamp and len(look.seen.kind):
                look.seen = _as_partner(look.seen)


def _as_partner(seen: Seen) -> Seen:
    """Return what others need: the images without the points."""
    nothing = np.zeros(0, np.uint8)
    return Seen(nothing, nothing.astype(np.float32), nothing, [_without_points(view) for view in seen.views])


def _without_points(view: View) -> View:
    nobody = np.zeros(0, np.bool_)
    return replace(view, rows=slice(0), is_object=nobody, is_supported=nobody, objects=np.zeros((3, 0), np.float32))
