"""The layout of the viewer Rerun: the world in three dimensions beside a summary and curves."""

from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.extras import import_extra
from automos.core.scan import Pose

EYE = (38.0, 250.0)
"""Metres that the eye is away from the middle of the drive, at least and at most."""


def load_rerun() -> Any:
    """Return the package rerun.

    Raises
    ------
    MissingExtraError
        It is not installed.
    """
    rerun, _ = (import_extra(name, "view", "the viewer needs Rerun: {1}") for name in ("rerun", "rerun.blueprint"))
    return rerun


def world_view(rrb: Any, eye: npt.ArrayLike, target: npt.ArrayLike, overrides: dict[str, Any] | None = None) -> Any:
    """Return the view in three dimensions, from `eye` (3,) to `target` (3,), which follows the sensor."""
    return rrb.Spatial3DView(
        name="world",
        origin="/world",
        contents="/world/**",
        overrides=overrides,
        background=[18, 22, 26],
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=eye,
            look_target=target,
            eye_up=[0.0, 0.0, 1.0],
            tracking_entity="/world/sensor",
        ),
    )


def blueprint(T_level_sensor: Pose, has_truth: bool, moving: tuple[int, int]) -> Any:
    """Return the layout: the world beside a summary and curves.

    The eye is behind and above the sensor and follows it, at a distance that grows with the length of the drive
    `T_level_sensor` (N, 4, 4). Playback covers the scans from `moving[0]` to `moving[1]`, in which something moves.
    """
    rr = load_rerun()
    rrb = rr.blueprint
    hidden = rrb.EntityBehavior(visible=False)
    path = T_level_sensor[:, :3, 3]
    target = path[moving[0]]
    away = float(np.clip(np.ptp(path[:, :2], axis=0).max(), *EYE))
    heading = T_level_sensor[moving[0], :2, 0]
    eye = target + away * np.array([-0.75 * heading[0], -0.75 * heading[1], 0.65])
    world = world_view(rrb, eye, target, {"/world/boxes/static": [hidden], "/world/unsure": [hidden]})
    names = {"moving_points": "points that move, %", "moving_objects": "objects that move"}
    curves = [rrb.TimeSeriesView(name=title, origin=f"/curves/{name}") for name, title in names.items()]
    if has_truth:
        axis = rrb.ScalarAxis(range=(0.0, 1.0))
        curves.append(rrb.TimeSeriesView(name="IoU against the truth", origin="/curves/iou", axis_y=axis))
    side = rrb.Vertical(rrb.TextDocumentView(name="run", origin="/run"), *curves)
    play = {"fps": 10.0, "play_state": "Playing", "loop_mode": "Selection"}
    selection = rr.encodings.AbsoluteTimeRange(*moving)
    return laid_out(rrb, rrb.Horizontal(world, side, column_shares=[3, 1]), time_selection=selection, **play)


def laid_out(rrb: Any, views: Any, **time: Any) -> Any:
    """Return the layout of `views` with all panels closed; `time` says how the scans are played."""
    return rrb.Blueprint(
        views,
        rrb.TimePanel(state="collapsed", timeline="scan", **time),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
