"""What the scans of a window say together: missing scans, the speed, the elevation of the beams, and their poses."""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from automos.odometry.beam_offset import find_elevation, longest_path
from automos.odometry.facing import ScoredPlaces
from automos.odometry.likely_speed import at_likely_speed
from automos.odometry.links import Consistency, Links
from automos.odometry.missing_scans import count_missing, with_gaps
from automos.odometry.refine import refine_poses
from automos.odometry.speed import SpeedSearch
from automos.odometry.submap import NOISE
from automos.odometry.window import Window
from automos.settings import OdometrySettings


class Settled(NamedTuple):
    """A window at its likely speed, the last search for that, and how well its scans align."""

    window: Window
    search: SpeedSearch
    consistency: Consistency


def settle(
    window: Window,
    n_known: int,
    links: Links,
    settings: OdometrySettings,
    pool: ThreadPoolExecutor | None,
    has_stamps: bool,
) -> Settled:
    """Return the scans at the likely speed, refined; the first `n_known` scans keep their poses.

    Missing scans are counted unless the scans have stamps.
    """
    if not has_stamps:
        is_free = np.arange(len(window.gaps)) >= n_known - 1
        counted = np.where(is_free, count_missing(window, settings, pool), window.gaps)
        window = window if (counted == window.gaps).all() else with_gaps(window, counted)
    window, search = at_likely_speed(window, settings, pool, n_known)
    window, consistency = refine_poses(window, settings, links, n_known, links.about.kernels[1:])
    return Settled(window, search, consistency)


def elevation_in(window: Window, pool: ThreadPoolExecutor | None) -> float:
    """Return the radians by which all beams point higher than the scans say, from the longest path in a window."""
    part = longest_path(window.T_world_sensor[:, :3, 3])
    return find_elevation(window.part(part.start, part.stop), pool) if len(window) > 2 else 0.0


def at_another_speed(window: Window, settings: OdometrySettings, scored: ScoredPlaces) -> Window | None:
    """Return the scans at another speed, None if there is none that is clearly better; the first keeps its pose.

    Speeds that differ by less than the noise of a surface from scan to scan are the same. For `scored`, see
    `score_speeds`.
    """
    found, _ = at_likely_speed(window, settings, None, scored=scored)
    change = np.linalg.norm((found.steps - window.steps)[:, :3, 3], axis=1) / window.gaps
    return found if change.max(initial=0.0) >= NOISE else None
