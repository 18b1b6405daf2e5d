import numpy as np
import pytest

from automos.core.errors import InputError
from automos.evidence.network_cue import add_cue, cue_fingerprint, read_cue
from automos.settings import SelfTrainingSettings


def test_a_network_that_does_not_know_changes_nothing():
    log_odds = np.linspace(-8.0, 8.0, 33).astype(np.float16)
    assert np.array_equal(add_cue(log_odds, np.full(33, 0.5), SelfTrainingSettings(weight=1.0)), log_odds)


def test_log_odds_add_up():
    # the network's 0.9 has log-odds 2.197, half of it 1.099
    got = add_cue(np.array([-0.5], np.float16), np.array([0.9]), SelfTrainingSettings(weight=0.5))
    assert got[0] == pytest.approx(0.599, abs=1e-3)


def test_what_was_clearly_seen_stands_against_the_network():
    got = add_cue(np.array([-6.0, 6.0], np.float16), np.array([1.0, 0.0]), SelfTrainingSettings(weight=1.0))
    assert got[0] < 0.0 < got[1]


def test_a_cue_that_does_not_belong_to_the_scan_is_told(tmp_path):
    np.save(tmp_path / "000000.npy", np.zeros(3))
    settings = SelfTrainingSettings(folder=str(tmp_path))
    with pytest.raises(InputError, match=r"shape \(3,\), but the scan has 5 points"):
        read_cue(settings, "000000", 5)
    with pytest.raises(InputError, match=r"000001.npy cannot be read .* automos segment --probabilities"):
        read_cue(settings, "000001", 5)


def test_another_cue_has_another_fingerprint(tmp_path):
    settings = SelfTrainingSettings(folder=str(tmp_path))
    before = cue_fingerprint(settings)
    np.save(tmp_path / "000000.npy", np.zeros(3))
    assert cue_fingerprint(settings) != before
