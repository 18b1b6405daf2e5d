"""Which other scans of a recording a scan is compared with."""

import numpy as np
import numpy.typing as npt


def scans_at(stamps: npt.NDArray, index: int, offsets: npt.ArrayLike) -> list[int]:
    """Return the scans nearest to `offsets` seconds after scan `index` (before it where negative), itself never.

    Where two offsets have the same nearest scan it is named once; where the recording has none within half an offset,
    none is. The order is that of `offsets`.

    stamps : (N,) seconds, increasing.
    """
    found: list[int] = []
    for offset in np.atleast_1d(np.asarray(offsets, np.float64)):
        away = np.abs(stamps - (stamps[index] + offset))
        j = int(away.argmin())
        if j != index and j not in found and away[j] <= 0.5 * abs(offset):
            found.append(j)
    return found
