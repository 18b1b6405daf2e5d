from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor

import pytest
from worlds import street

from automos import load_settings
from automos.online.segmenting import GROWN, Segmenting


def test_evidence_of_a_scan_is_updated_halfway_and_when_it_is_complete():
    updated = defaultdict(list)
    with ThreadPoolExecutor(1) as pool:
        segmenting = Segmenting(load_settings(), 0.0, pool, True, True, None)
        for k, scan in enumerate(street(22).sequence):
            for found in segmenting.step(k, scan).renewed:
                one = found.result()
                updated[round(one.stamp, 3)].append((scan.stamp - one.stamp, one.is_far))
    for stamp in (0.5, 0.8):  # the first scans were compared with few, and are updated as more come
        (halfway, _), (complete, is_far) = updated[stamp]
        assert (halfway, complete) == (pytest.approx(0.5 * GROWN), pytest.approx(GROWN))
        assert is_far
