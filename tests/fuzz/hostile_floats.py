"""What damaged files hold where coordinates should be, and what kernels are given made of it."""

import ast
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import automos
from automos.core.beam_pattern import BeamPattern
from automos.core.beam_pattern import make_pattern as pattern_of
from automos.core.scan import Frame
from automos.core.upright_boxes import Boxes
from automos.objects.tracks import Tracks
from automos.settings import load_settings

SOURCE = Path(automos.__file__).parent
SETTINGS = load_settings("default")

_EDGES = (0.0, -0.0, 1e-45, 1e-38, 0.05, 1.0, 19_999.0, 2.0**31, 5e18, 9.3e18, 1.7e19, 1.9e19, 3.4e38, np.inf)
HOSTILE = (
    st.sampled_from([*_EDGES, *(-edge for edge in _EDGES), np.nan]) | st.floats(width=32) | st.floats(-60, 60, width=32)
)
CLOUDS = st.integers(1, 40).flatmap(lambda n: hnp.arrays(np.float32, (n, 3), elements=HOSTILE))
"""(N, 3) float32: ordinary numbers, those at which arithmetic or a whole number overflows, and no numbers."""


def make_pattern(row_of_sine: np.ndarray | None = None) -> BeamPattern:
    rows = np.linspace(-2.0, 18.0, 4097, dtype=np.float32) if row_of_sine is None else row_of_sine
    times = np.linspace(-0.5, 0.5, 360).astype(np.float32)
    return pattern_of(0.02 * np.arange(16), 2.0 * np.pi / 64, times)._replace(row_of_sine=rows)


def make_frame(points: np.ndarray) -> Frame:
    n = len(points)
    motion = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.1])
    return Frame(points, np.arange(n), n, np.eye(4), 0.0, points[:, 0].copy(), motion)


def make_boxes(points: np.ndarray) -> Boxes:
    return Boxes(
        points.astype(float), np.roll(points, 1, 0).astype(float), points[:, 0].astype(float), np.ones(len(points))
    )


def make_tracks(points: np.ndarray) -> Tracks:
    n, wide = len(points), points.astype(float)
    return Tracks(np.arange(n), np.zeros(n, int), np.arange(n) - 1, wide, np.roll(wide, 1, 0), wide[:, 0], wide)


def kernels() -> Iterator[tuple[Path, str]]:
    """Yield the file and name of every compiled kernel that may be given what was read."""
    for path in sorted(set(SOURCE.rglob("*.py")) - set((SOURCE / "simulation").rglob("*.py"))):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef) and any("kernel" in ast.unparse(d) for d in node.decorator_list):
                yield path, node.name
