import json

import numpy as np
import pytest
from labelled_worlds import changes_move, settings, write_labelled
from worlds import lane

from automos.core.errors import InputError
from automos.evaluation.report import evaluate_folder
from automos.network.segment import segment_recording, summary
from automos.readers import open_sequence


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return open_sequence(write_labelled(lane(5), tmp_path_factory.mktemp("lane")))


def test_labels_are_written_as_automos_label_writes_them(recording, tmp_path):
    run = segment_recording(recording, tmp_path / "run", changes_move(), settings(), probabilities=True)
    assert evaluate_folder(tmp_path / "run" / "predictions", recording).counts.n_scans == 5
    for i, name in enumerate(recording.names):
        labels = np.fromfile(tmp_path / "run" / "predictions" / f"{name}.label", np.uint32)
        probability = np.load(tmp_path / "run" / "probabilities" / f"{name}.npy")
        assert len(labels) == len(probability) == len(recording[i])
        assert set(np.unique(labels)) <= {9, 251}
    assert run == json.loads((tmp_path / "run" / "run.json").read_text())
    assert sum(run["points"].values()) == sum(len(scan) for scan in recording)
    assert "5 scans" in summary(run, tmp_path / "run")
    assert (tmp_path / "run" / "poses.txt").read_text().count("\n") == 5


def test_another_programs_labels_are_not_written_over(recording, tmp_path):
    (tmp_path / "theirs" / "predictions").mkdir(parents=True)
    (tmp_path / "theirs" / "predictions" / "000000.label").touch()
    (tmp_path / "labelled" / "stages" / "labels-0").mkdir(parents=True)
    for name in ("theirs", "labelled"):
        with pytest.raises(InputError, match=r"automos (segment did not write|did not make that folder)"):
            segment_recording(recording, tmp_path / name, changes_move(), settings())
