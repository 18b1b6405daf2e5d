"""Image grids for tests."""

import numpy as np

from automos.network.projection import SINE_BINS, ImageGrid


def even_grid(height: int, width: int, up_deg: float, down_deg: float) -> ImageGrid:
    """Return a grid of rows evenly spaced between two elevations in degrees (paper: HDL-64E, +3 to -25)."""
    elevation = np.degrees(np.arcsin(np.linspace(-1.0, 1.0, SINE_BINS + 1)))
    row = (up_deg - elevation) / (up_deg - down_deg) * height
    return ImageGrid(height, width, row.astype(np.float32))
