import numpy as np

from automos import ArraySequence, Scan
from automos.core.views import distinct_scans

IS_REPEAT = np.array([False, True, False, True, True])


def test_repeated_scans_are_left_out():
    scans = [Scan(np.full((1, 3), i + 1.0, np.float32), name=f"{i}") for i in range(5)]
    distinct = distinct_scans(ArraySequence(scans, stamps=0.1 * np.arange(5)), IS_REPEAT)
    assert distinct.names == ["0", "2"]
    assert [scan.points[0, 0] for scan in distinct] == [1.0, 3.0]
    np.testing.assert_allclose(distinct.stamps, [0.0, 0.2])
