"""Writers of point files and a small sweep, for the tests of readers."""

import numpy as np
import pytest
from point_writers import pack_lzf, write_points


@pytest.fixture(name="write_points", scope="session")
def _write_points():
    """Return the writer."""
    return write_points


@pytest.fixture(name="pack_lzf", scope="session")
def _pack_lzf():
    """Return the compressor."""
    return pack_lzf


@pytest.fixture
def columns():
    """Return a small sweep with everything a driver may write."""
    rng = np.random.default_rng(0)
    xyz = rng.normal(size=(3, 500)).astype(np.float32) * 10
    return {
        "x": xyz[0],
        "y": xyz[1],
        "z": xyz[2],
        "intensity": rng.integers(0, 256, 500).astype(np.float32),
        "t": np.linspace(5, 1e8 + 5, 500).astype(np.uint32),
        "ring": np.arange(500).astype(np.uint16) % 64,
    }
