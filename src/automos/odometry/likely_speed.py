"""The scans of a window at their likely speed: as registered, as all surfaces say, as landmarks say, or from rest.

Each is a hypothesis that is aligned and judged by the landmarks that are re-observed then.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from automos.core.geometry import Array
from automos.odometry.facing import ScoredPlaces
from automos.odometry.landmarks import is_ahead
from automos.odometry.links import Alignment, Links, share_close
from automos.odometry.motion import can_be_driven
from automos.odometry.refine import align
from automos.odometry.speed import SpeedSearch, direction_of, lengthen, rivals_from_rest, search_speed
from automos.odometry.window import ROUNDS, Window
from automos.settings import OdometrySettings


def at_likely_speed(
    window: Window,
    settings: OdometrySettings,
    pool: ThreadPoolExecutor | None,
    n_known: int = 1,
    scored: ScoredPlaces | None = None,
) -> tuple[Window, SpeedSearch]:
    """Return the window at the speed that surfaces along the path or landmarks favour, and the last search.

    Around a wrong speed, registered poses are wrong in other ways, too, so unless landmarks say clearly that it is
    right, it is searched from a standstill. The first `n_known` scans keep their poses.

    scored : places of earlier windows of the same path, see `score_speeds`.
    """
    trial = _Trial(settings, pool, n_known, Links(Alignment(), pool))
    first = search_speed(window, settings, pool, scored)
    if first.is_clear and not first.missing.any():
        return window, first
    found, search = trial.settled(window, first)
    # What landmarks alone propose, from the poses as registered and from those that all surfaces have led to.
    for rival, start in ((first, window), (search, found)):
        is_possible = can_be_driven(found.T_world_sensor, found.clock)
        if is_ahead(rival.landmarks_at_rival, search.landmarks, is_possible):
            other, there = trial.from_there(trial.longer(start, rival.rival))
            if is_ahead(there.landmarks, search.landmarks, is_possible):
                found, search = other, there
    still = trial.at_rest(window)
    for k, rival in enumerate(rivals_from_rest(still, direction_of(window.steps), settings, pool, scored)):
        # No vehicle drives sideways: walls, which show that, and scans as a whole have to say so, too.
        is_across, proposed = k > 0, rival.landmarks_at_rival
        beaten = [search.landmarks, rival.landmarks] if is_across else [search.landmarks]
        if all(proposed.explains_more_than(other) for other in beaten):
            start = trial.longer(still, rival.rival)
            other, there = trial.from_there(start)
            if proposed.lead_over(there.landmarks) > 0.0:  # few scans may be aligned elsewhere
                other, there = start, search_speed(start, settings, pool)
            is_possible = not is_across or trial.share(other) >= trial.share(found)
            if is_possible and there.landmarks.lead_over(search.landmarks) > 0.0:
                found, search = other, there
        if search.is_clear:
            break
    return found, search


def to_likely_speed(window: Window, settings: OdometrySettings, pool: ThreadPoolExecutor | None = None) -> Window:
    """Return the scans at the speed that landmarks clearly favour, or else at that of all surfaces; not refined."""
    found = search_speed(window, settings, pool)
    is_rival = is_ahead(found.landmarks_at_rival, found.landmarks, True)
    return window.moved(lengthen(window.T_world_sensor, found.rival if is_rival else found.missing))


@dataclass(frozen=True)
class _Trial:
    """Tries other speeds of a window whose first `n_known` scans keep their poses."""

    settings: OdometrySettings
    pool: ThreadPoolExecutor | None
    n_known: int
    links: Links

    def at_rest(self, window: Window) -> Window:
        """Return the window without any motion, turned as it is."""
        T = window.T_world_sensor.copy()
        T[self.n_known :, :3, 3] = T[self.n_known - 1, :3, 3]
        return window.moved(T)

    def share(self, window: Window) -> float:
        """Return the share of surfels that lie on the surfaces of submaps, of all scans."""
        return share_close(self.links.fit(window, self.links.choose(window), self.links.about.kernels[-1]))

    def longer(self, window: Window, missing: Array) -> Window:
        """Return the window with `missing` (N - 1, 3) added to its steps."""
        return window.moved(lengthen(window.T_world_sensor, self._free(missing)))

    def from_there(self, start: Window) -> tuple[Window, SpeedSearch]:
        """Return the window aligned from there, at the speed to which searches lead then, and the last one."""
        window = align(start, self.settings, self.links, self.n_known)[0]
        return self.settled(window, search_speed(window, self.settings, self.pool))

    def settled(self, window: Window, search: SpeedSearch) -> tuple[Window, SpeedSearch]:
        """Return the window at the speed to which the `search` from its poses leads, and the last search."""
        for _ in range(ROUNDS - 1):
            if not self._free(search.missing).any():
                break
            window = align(self.longer(window, search.missing), self.settings, self.links, self.n_known)[0]
            search = search_speed(window, self.settings, self.pool)
        return window, search

    def _free(self, missing: Array) -> Array:
        is_free = np.arange(len(missing)) >= self.n_known - 1
        return np.where(is_free[:, None], missing, 0.0)
