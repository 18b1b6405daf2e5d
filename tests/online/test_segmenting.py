from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor

import pytest
from worlds import street

from automos import load_settings
from automos.online.following import GROWN
from automos.online.segmenting import Segmenting
from automos.online.sighting import Sightings


@pytest.mark.parametrize(("lag", "ages"), [(0.0, [0.5 * GROWN, GROWN]), (0.5 * GROWN, [GROWN]), (GROWN, [])])
def test_evidence_of_a_scan_is_updated_halfway_and_when_it_is_complete_unless_the_lag_is_as_long(lag, ages):
    updated = defaultdict(list)
    with ThreadPoolExecutor(1) as pool:
        settings = load_settings()
        segmenting = Segmenting(settings, lag, pool, Sightings(settings, pool, True, True, None))
        for k, scan in enumerate(street(22).sequence):
            for found in segmenting.step(k, scan).renewed:
                one = found.result()
                updated[round(one.stamp, 3)].append((scan.stamp - one.stamp, one.is_far))
    for stamp in (0.5, 0.8):  # the first scans were compared with few, and are updated as more come
        assert [age for age, _ in updated[stamp]] == pytest.approx(ages)
        assert all(is_far for age, is_far in updated[stamp] if age > 0.75 * GROWN)
