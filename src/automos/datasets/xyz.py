"""Points as text, one a line: x y z [intensity [ring]], or columns named in the first line.

Blanks, tabs, commas or semicolons divide the columns; lines starting with # or // are comments, and a comment in the
first line that names x, y and z names the columns.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from automos.datasets.columns import Columns, from_matrix
from automos.errors import InputError

_DIVIDERS = str.maketrans(",;\t", "   ")
_COMMENTS = ("#", "//")


def read(path: Path) -> Columns:
    """Return the columns of one file, by the names in its first line or as x, y, z, intensity, ring."""
    lines = [line for line in path.read_text(errors="replace").translate(_DIVIDERS).splitlines() if line.strip()]
    names = _names(lines[0]) if lines else []
    rows = [line for line in lines[1 if names else 0 :] if not line.lstrip().startswith(_COMMENTS)]
    if not rows:
        return from_matrix(np.zeros((0, 3)), path)
    try:
        matrix = np.loadtxt(rows, comments=list(_COMMENTS), ndmin=2)
    except ValueError as error:
        raise InputError(f"{path} is not a table of numbers: {error}") from None
    if not names:
        return from_matrix(matrix, path)
    if len(names) != matrix.shape[1]:
        raise InputError(f"{path} names {len(names)} columns in its first line but has {matrix.shape[1]}")
    return dict(zip(names, matrix.T, strict=True))


def _names(first_line: str) -> list[str]:
    """Return the column names that the first line holds, none if it holds numbers or a remark."""
    words = first_line.lstrip("#/ ").split()
    if first_line.lstrip().startswith(_COMMENTS):
        return words if {"x", "y", "z"} <= {word.lower() for word in words} else []
    try:
        [float(word) for word in words]
    except ValueError:
        return words
    return []
