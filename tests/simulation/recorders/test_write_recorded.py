"""What lies on disk is what a reader of the layout finds: the same points, labels, times and clock."""

import numpy as np
import pytest

from automos import open_sequence
from automos.core.errors import InputError
from automos.simulation import Convention, record, write_recorded
from automos.simulation.recorders.write import EPOCH


def made(**about):
    return record("canyon", "VLP-16", 3, 4, convention=Convention(**about))


@pytest.mark.parametrize("times", ["none", "relative", "absolute", "milliseconds"])
def test_points_labels_times_and_stamps_are_read_back(tmp_path, times):
    recorded = made(turns=0.92, order="random", times=times)
    found = open_sequence(write_recorded(recorded, tmp_path / "out"))
    assert len(found) == len(recorded)
    if times == "absolute":  # the points' clock is the recording's: of each scan's first point, since 1970
        assert found.stamps - EPOCH == pytest.approx(recorded.stamps - 0.046, abs=2e-4)
    else:
        assert found.stamps == pytest.approx(recorded.stamps, abs=1e-6)
    assert found.reference_poses == pytest.approx(recorded.reference_poses, abs=1e-9)
    for k in range(len(found)):
        assert np.array_equal(found[k].points, recorded[k].points)
        assert np.array_equal(found.truth(k), recorded.truth(k))
        if times == "none":
            assert found[k].time is None
        else:
            assert found[k].time == pytest.approx(
                recorded[k].time, abs=2e-6
            )  # as fine as a double's seconds since 1970
            assert np.array_equal(found[k].ring, recorded[k].ring)


def test_no_clock_no_times_and_the_folder_can_be_written_again(tmp_path):
    write_recorded(made(), tmp_path)
    assert (tmp_path / "times.txt").exists()
    write_recorded(made(stamps=False, turns=2.0), tmp_path)
    assert not (tmp_path / "times.txt").exists()
    assert len(open_sequence(tmp_path)) == 1


def test_a_folder_of_others_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(InputError, match="automos did not make that folder: choose another --out"):
        write_recorded(made(), tmp_path)
    with pytest.raises(InputError, match=r"thesis\.tex is a file: choose another --out"):
        write_recorded(made(), tmp_path / "thesis.tex")
