"""Refinement of poses: every scan is aligned with submaps half a second to a few seconds away.

Registration to the scans just before accumulates small errors, and traffic that keeps pace with the sensor looks like a
static world. Over longer baselines, errors of centimetres produce double walls, and moving objects have left their
position. All links are solved together with a weak prior on even motion, which bridges scans without links.
"""

from collections.abc import Iterable

import numpy as np

from automos.core.geometry import adjoint, inverse, se3_exp, se3_log, transform
from automos.core.normal_equations import NormalEquations
from automos.core.scan import Pose
from automos.odometry.links import Consistency, Link, Links, consistency_of, that_match
from automos.odometry.submap import Fit
from automos.odometry.surfels import SURFEL
from automos.odometry.window import SAME_POSE, Window
from automos.settings import OdometrySettings

INFORMATION = 0.05
"""Share of a surfel's weight that counts, since errors of neighbouring surfels are correlated."""
WIDE = 3.0
"""Metres between points that match, at most: a sensor in a hand is turned within a scan by more than surfaces are
looked for."""
LOOSE = 1e-3  # prior information on every pose, which keeps scans without links in place


def align(
    window: Window, settings: OdometrySettings, links: Links, n_fixed: int = 1, kernels: Iterable[float] | None = None
) -> tuple[Window, Window, list[Link], list[Fit]]:
    """Return the scans at refined poses, and at those of the last fits of links; the first `n_fixed` keep their poses.

    kernels : metres, one per iteration; those of the links by default.
    """
    chosen = [link for link in links.choose(window) if max(link) >= window.first + n_fixed]
    for kernel in links.about.kernels if kernels is None else kernels:
        before, fits = window, links.fit(window, chosen, kernel)
        window, moved = solve_links(window, chosen, fits, settings, n_fixed)
        if moved < SAME_POSE:
            break
    return window, before, chosen, fits


def refine_poses(
    window: Window, settings: OdometrySettings, links: Links, n_fixed: int = 1, kernels: Iterable[float] | None = None
) -> tuple[Window, Consistency]:
    """Return the scans at refined poses, and how well they align; see `align`."""
    refined, before, chosen, fits = align(window, settings, links, n_fixed, kernels)
    return refined, consistency_of(before, chosen, fits)


def solve_links(
    window: Window, links: list[Link], fits: list[Fit], settings: OdometrySettings, n_fixed: int = 1
) -> tuple[Window, float]:
    """Return the scans at the poses that the `fits` of `links` and even motion favour, and the greatest change (m).

    Equation: window
    """
    equations = NormalEquations(len(window), n_fixed, LOOSE)
    _add_links(equations, links, fits, window)
    _add_even_motion(equations, window, settings)
    steps = equations.solve()
    return window.moved(window.T_world_sensor @ se3_exp(steps)), float(np.abs(steps[:, :3]).max())


def _add_links(equations: NormalEquations, links: list[Link], fits: list[Fit], window: Window) -> None:
    """Add the links of scans with submaps that match enough surfels."""
    (scan, center), good = that_match(links, fits, window)
    T = window.T_world_sensor
    H = INFORMATION * np.array([fit.H for fit in good]).reshape(-1, 6, 6)
    g = INFORMATION * np.array([fit.g for fit in good]).reshape(-1, 6)
    of_scan = adjoint(inverse(T[center]) @ T[scan])
    equations.add([(center, np.tile(-np.eye(6), (len(good), 1, 1))), (scan, of_scan)], H, g)


def _add_even_motion(equations: NormalEquations, window: Window, settings: OdometrySettings) -> None:
    """Add the prior of constant motion for every scan with two neighbours."""
    gaps = window.gaps
    if len(window) < 3:
        return
    steps = window.steps
    change = np.diff(se3_log(steps) / gaps[:, None], axis=0)
    back = adjoint(inverse(steps))
    usual = np.repeat([settings.usual_acceleration, np.radians(settings.usual_turn_acceleration_deg)], 3)
    information = 1.0 / (usual * (window.period**2 * np.maximum(gaps[:-1], gaps[1:]))[:, None]) ** 2  # (N - 2, 6)
    per_gap = 1.0 / gaps[:, None, None]
    first = np.arange(len(change))
    of_middle = -back[1:] * per_gap[1:] - np.eye(6) * per_gap[:-1]
    parts = [(first, back[:-1] * per_gap[:-1]), (first + 1, of_middle), (first + 2, np.eye(6) * per_gap[1:])]
    equations.add(parts, information, information * change)


def first_steps(T: Pose, fastest: float) -> Pose:
    """Return (K, 4, 4) where the scan after the first one, at `T`, is looked for: to all four sides, at all speeds.

    A registration that starts at rest may stay there; it leads to what lies a voxel ahead. `fastest` : metres.
    """
    axes = np.concatenate([np.eye(6)[:2], -np.eye(6)[:2]])
    steps = np.arange(2.0 * SURFEL, max(fastest, 4.0 * SURFEL), 2.0 * SURFEL)
    return T @ se3_exp(np.concatenate([step * axes for step in steps]))


def registered(window: Window) -> Pose:
    """Return the (4, 4) pose of the newest scan by registration of its points with those of the scans before it."""
    import small_gicp

    before = [
        transform(T, surfels.mean.astype(np.float64))
        for T, surfels in zip(window.T_world_sensor[:-1], window.surfels[:-1], strict=True)
    ]
    newest, T = window.surfels[-1].mean.astype(np.float64), window.T_world_sensor[-1]
    found = small_gicp.align(
        np.concatenate(before), newest, T, registration_type="GICP", max_correspondence_distance=WIDE
    )
    return found.T_target_source
