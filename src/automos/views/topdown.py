"""Labels seen from above, against the truth where there is one, as in Fig. 4 of the paper."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path
from automos.core.geometry import Array
from automos.core.label_files import to_mos
from automos.core.labels import Label

UNLABELED, STATIC, MOVING, FALSE, MISSED = range(5)
"""As it was labelled; moving though the truth says static; not moving though the truth says moving."""


def verdicts(labels: npt.NDArray, truth: npt.NDArray | None) -> npt.NDArray[np.uint8]:
    """Return (N,) the verdict on each point with `labels` (N,); a point without truth of its own is never wrong.

    truth : (N,) classes as SemanticKITTI numbers them; None where the scan has none.
    """
    kinds = np.select([labels == Label.MOVING, labels == Label.STATIC], [MOVING, STATIC], UNLABELED).astype(np.uint8)
    if truth is not None:
        true = to_mos(truth)
        kinds[(kinds == MOVING) & (true == Label.STATIC)] = FALSE
        kinds[(kinds < MOVING) & (true == Label.MOVING)] = MISSED
    return kinds


COLORS = {
    STATIC: ("true static", "#9aa0a6"),
    MOVING: ("true moving", "#0a9d3c"),
    FALSE: ("false moving", "#e0262b"),
    MISSED: ("missed", "#1f5fff"),
}
"""The paper's true static, true dynamic, false dynamic, false static."""

GREYS = ("#c9cdd2", "#a4a9ae", "#50555a")
"""Greys of static points, from the ground up to two metres above it."""


@dataclass(frozen=True, eq=False)
class View:
    """One picture: points (N, 3) in metres, labels (N,), truth (N,) or None, both uint8 of `Label`."""

    title: str
    points: npt.NDArray
    labels: npt.NDArray[np.uint8]
    truth: npt.NDArray[np.uint8] | None = None


def draw_views(
    views: list[View], path: Path, center: Array, radius: float, tracks: list[Array] | None = None, columns: int = 3
) -> None:
    """Write the views side by side, all of the same square of ground, to a PNG file.

    Parameters
    ----------
    center : (2,) array
        Metres, the middle of the square.
    radius : float
        Metres, half its side.
    tracks : list of array, optional
        Paths (T, 2 or 3) of moving objects, drawn as lines into every view.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    greys = LinearSegmentedColormap.from_list("static", GREYS)
    columns = min(columns, len(views))
    rows = -(-len(views) // columns)
    figure = Figure(figsize=(7.0 * columns, 7.3 * rows + 0.5), dpi=110, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(views) :]:
        axis.set_axis_off()
    for axis, view in zip(axes, views, strict=False):
        found = np.maximum(verdicts(view.labels, view.truth), STATIC)  # what is unlabeled is drawn as static
        for kind, (_, color) in COLORS.items():
            x, y, z = view.points[found == kind].T
            if kind == STATIC:  # the ground lighter than what stands on it
                style = {"s": 0.3, "c": z, "cmap": greys, "vmin": -0.5, "vmax": 2.0}
            else:
                style = {"s": 1.6, "c": color}
            axis.scatter(x, y, linewidths=0, rasterized=True, **style)
        for track in tracks or []:
            axis.plot(track[:, 0], track[:, 1], color="black", linewidth=0.6, alpha=0.5)
        axis.set(xlim=(center[0] - radius, center[0] + radius), ylim=(center[1] - radius, center[1] + radius))
        axis.set_aspect("equal")
        axis.set_title(view.title)
        axis.set(xticks=[], yticks=[])
        _draw_scale(axis, radius)
    handles = [Line2D([], [], marker="o", linestyle="", color=color, label=name) for name, color in COLORS.values()]
    if tracks:
        handles.append(Line2D([], [], color="black", alpha=0.5, label="path of what moves"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        FigureCanvasAgg(figure).print_png(file)


def _draw_scale(axis: Any, radius: float) -> None:
    """Draw a bar of a round number of metres, about a fifth of the picture long, into its lower left corner."""
    length = max(step for step in (1, 2, 5, 10, 20, 50, 100, 200) if step <= max(0.4 * radius, 1.0))
    share = length / (2.0 * radius)
    bar = {"transform": axis.transAxes, "color": "black", "solid_capstyle": "butt"}
    axis.plot([0.03, 0.03 + share], [0.03, 0.03], linewidth=7, **{**bar, "color": "white"})
    axis.plot([0.03, 0.03 + share], [0.03, 0.03], linewidth=3, **bar)
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5}
    axis.text(0.03 + 0.5 * share, 0.045, f"{length} m", transform=axis.transAxes, ha="center", bbox=box)
