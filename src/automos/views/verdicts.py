"""What a point's label and its truth make of it; pictures show it in colours."""

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label, to_mos

UNLABELED, STATIC, MOVING, FALSE, MISSED = range(5)
"""As it was labelled; moving though the truth says static; not moving though the truth says moving."""


def verdicts(labels: npt.NDArray, truth: npt.NDArray | None) -> npt.NDArray[np.uint8]:
    """Return (N,) the verdict on each point with `labels` (N,); a point without truth of its own is never wrong.

    truth : (N,) classes as SemanticKITTI numbers them; None where the scan has none.
    """
    kinds = np.select([labels == Label.MOVING, labels == Label.STATIC], [MOVING, STATIC], UNLABELED).astype(np.uint8)
    if truth is not None:
        true = to_mos(truth)
        kinds[(kinds == MOVING) & (true == Label.STATIC)] = FALSE
        kinds[(kinds < MOVING) & (true == Label.MOVING)] = MISSED
    return kinds
