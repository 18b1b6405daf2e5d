"""Division of recordings into overlapping submaps, which bounds the memory of methods that build a map."""

import numpy as np
import numpy.typing as npt


def cut_submaps(origins: npt.NDArray, max_scans: int, max_length: float) -> list[tuple[int, int, int, int]]:
    """Return submaps as rows (first, last, own_first, own_last), half-open scan ranges.

    The own ranges tile the recording. A submap extends beyond its own range on both sides, so that an object at the end
    of the range is still observed to leave. Both scans and metres are bounded: a parked car records thousands of scans
    in one place, while a motorway drive leaves a place within seconds.

    origins : (N, 3) metres, sensor positions.   max_scans, max_length : of one submap, scans and metres driven.
    """
    n = len(origins)
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(origins, axis=0), axis=1))])[:n]
    submaps = []
    own_first = 0
    half_scans, half_length = max_scans // 2, max_length / 2
    while own_first < n:
        own_last = int(np.searchsorted(travelled, travelled[own_first] + half_length, side="right"))
        own_last = min(own_last, own_first + half_scans, n)
        if n - own_last < half_scans // 2 and travelled[-1] - travelled[own_last - 1] < half_length / 2:
            own_last = n  # no short rest at the end
        reach_back = int(np.searchsorted(travelled, travelled[own_first] - half_length / 2))
        reach_on = int(np.searchsorted(travelled, travelled[own_last - 1] + half_length / 2, side="right"))
        first = max(reach_back, own_first - half_scans // 2, 0)
        last = min(reach_on, own_last + half_scans // 2, n)
        submaps.append((first, last, own_first, own_last))
        own_first = own_last
    return submaps
