"""The comparison of timing hypotheses by the misfits of the links of a few windows."""

import numpy as np
import pytest

from automos.odometry.moving_windows import Search
from automos.odometry.sweep_timing import SweepTiming
from automos.settings import OdometrySettings

NONE, REAR = SweepTiming(), SweepTiming("azimuth", turn=-1, seam_deg=180.0, share=1.0)


def search_with(misfits):
    """A search in which each hypothesis has the given misfits of 16 links."""
    search = Search(OdometrySettings(), None)
    search.windows = [None]
    search._evaluate = lambda guesses, is_rough: np.array([misfits[guess] for guess in guesses])
    return search


def less_by(gain, scatter):
    """Misfits of 16 links: `gain` less than those of `NONE` on average, with a scatter of `scatter`."""
    return -gain + scatter * np.tile([-1.0, 1.0], 8)


def test_the_sign_of_an_uncertain_difference_decides_between_timings():
    # 3 % better; six links of a scan are correlated, so the standard error is 0.06 / sqrt(16 / 6) = 3.7 %.
    search = search_with({NONE: np.zeros(16), REAR: less_by(0.03, 0.06)})
    assert search.best([NONE, REAR]) == REAR


def test_a_difference_below_a_percent_changes_nothing():
    search = search_with({NONE: np.zeros(16), REAR: less_by(0.009, 0.0)})
    assert search.best([NONE, REAR]) == NONE


@pytest.mark.parametrize(("gain", "is_chosen"), [(0.054, False), (0.057, True)])
def test_a_seam_selected_among_many_must_be_better_by_one_and_a_half_standard_errors(gain, is_chosen):
    search = search_with({NONE: np.zeros(16), REAR: less_by(gain, 0.06)})
    assert (search.best([NONE], selected=[REAR]) == REAR) is is_chosen


@pytest.mark.parametrize(("gain", "is_clear"), [(0.054, False), (0.057, True)])
def test_one_and_a_half_standard_errors_are_clear(gain, is_clear):
    search = search_with({NONE: np.zeros(16), REAR: less_by(gain, 0.06)})
    search.is_clear = True
    assert search.best([NONE, REAR]) == REAR
    assert search.is_clear is is_clear


@pytest.mark.parametrize(("gain", "is_ahead"), [(0.054, False), (0.057, True)])
def test_what_is_assumed_is_kept_until_another_timing_is_clearly_better(gain, is_ahead):
    search = search_with({REAR: np.zeros(16), NONE: less_by(gain, 0.06)})  # a standard error of 3.7 %
    assert search.is_ahead(NONE, REAR) is is_ahead
