from pathlib import Path

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.core.geometry import make_transform
from automos.readers.stamped_poses import poses_at


def test_poses_are_not_made_up_where_there_are_none_for_a_while():
    stamps = 0.1 * np.arange(91)
    T = np.stack([make_transform(t=[5.0 * t, 0.0, 0.0]) for t in stamps])
    np.testing.assert_allclose(poses_at(stamps, stamps[::10], T[::10], Path("gt.txt")), T, atol=1e-9)
    is_kept = (stamps < 3.0) | (stamps > 6.0)
    with pytest.raises(InputError, match=r"gt.txt has no pose for scan 40 \(time 4\.0.*the nearest is 1\.1. s away"):
        poses_at(stamps, stamps[is_kept], T[is_kept], Path("gt.txt"))
