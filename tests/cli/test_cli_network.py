"""The commands of the network as a user meets them; what goes wrong is one sentence and exit code 2."""

import json
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from worlds import lane, write_bins

from automos.cli import main
from automos.core.claims import EXPERIMENT, claim
from automos.core.label_files import pack
from automos.core.pose_writers import write_kitti

HAS_SHIPPED = (Path(__file__).parents[2] / "src" / "automos" / "network" / "lmnet.onnx").exists()
TINY = [
    *("--set", "network.image.height=16", "--set", "network.image.width=64", "--set", "network.image.residuals=2"),
    *("--set", "network.model.channels=4", "--set", "network.training.epochs=1", "--set", "odometry.time=none"),
]


@pytest.fixture
def automos(monkeypatch, capsys, tmp_path):
    """Return a function that runs the command line in an empty folder and returns exit code, output and errors."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")

    def run(*words) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["automos", *map(str, words)])
        with pytest.raises(SystemExit) as leaving:
            main()
        said = capsys.readouterr()
        return leaving.value.code or 0, said.out, said.err

    return run


@pytest.fixture
def log(tmp_path):
    """Return a folder of .bin files without labels."""
    return write_bins(lane(5).sequence, tmp_path / "log")


@pytest.fixture
def labelled(tmp_path):
    """Return a sequence with labels."""
    world = lane(5)
    folder = tmp_path / "lane"
    write_bins(world.sequence, folder / "velodyne")
    write_kitti(folder / "poses.txt", world.poses)
    (folder / "labels").mkdir()
    for name, label in zip(world.sequence.names, world.truth, strict=True):
        pack(label).tofile(folder / "labels" / f"{name}.label")
    return folder


def test_help_shows_examples(automos):
    for command, example in (("train", "--init best.pt"), ("segment", "--device gpu"), ("reproduce", "table2 --out")):
        code, out, _ = automos(command, "--help")
        assert code == 0
        assert example in " ".join(out.split())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["segment", "LOG", "--weights", "none.pt"], "none.pt does not exist: give a checkpoint"),
        (["segment", "nowhere"], "nowhere does not exist"),
        (["reproduce", "table9"], "there is no experiment 'table9': choose table2, table3 or network"),
        (["reproduce", "table2", "--train", "LOG"], "need all of --train, --validation and --test"),
        (["train", "--data", "LOG="], "names no results folder after '='"),
        (["train", "--data", "LOG", "--set", "network.model.chanels=8"], "did you mean 'network.model.channels'"),
    ],
)
def test_a_mistake_is_one_sentence(automos, log, words, said):
    if words[0] == "train":
        pytest.importorskip("torch", reason="training needs PyTorch: pip install '.[train]'")
    code, _, error = automos(*(word.replace("LOG", str(log)) for word in words))
    assert code == 2
    assert said in error
    assert error.strip().count("\n") == 0


def test_recordings_without_labels_are_not_trained_on(automos, log):
    pytest.importorskip("pytorch_lightning", reason="training needs Lightning: pip install '.[train]'")
    code, _, error = automos("train", "--data", log, "--out", "network", *TINY)
    assert code == 2
    assert "log came without labels: label it first" in error


@pytest.mark.filterwarnings("ignore::UserWarning", "ignore::FutureWarning")
def test_train_segment_and_evaluate_from_the_command_line(automos, labelled):
    pytest.importorskip("pytorch_lightning", reason="training needs Lightning: pip install '.[train]'")
    code, out, error = automos("train", "--data", labelled, "--out", "network", "--device", "cpu", *TINY)
    assert code == 0, error
    assert "network/best.pt" in out
    assert "training on the CPU" in error
    words = ("segment", labelled, "--weights", "network/best.pt", "--out", "run", "--device", "cpu")
    code, out, error = automos(*words, "--set", "odometry.time=none")
    assert code == 0, error
    assert "5 scans" in out
    code, out, _ = automos("evaluate", "run", labelled)
    assert code == 0
    assert "all points" in out


def test_a_recording_is_segmented_by_the_evidence_at_a_lag(automos, log):
    code, out, error = automos("segment", log, "--lag", "0.2", "--out", "run")
    assert code == 0, error
    assert "lag 0.2 s" in out
    assert sorted(p.stem for p in Path("run/predictions").iterdir()) == [f"{i:06d}" for i in range(5)]


def test_segment_takes_a_folder_that_nobody_chose_for_one_recording_alone(automos, log, tmp_path):
    other = write_bins(lane(4).sequence, tmp_path / "other" / "log")
    code, _, error = automos("segment", log)
    assert code == 0, error
    assert json.loads(Path("automos_segmented/log/run.json").read_text())["recording"]["source"] == str(log)
    code, _, error = automos("segment", other)
    assert code == 2
    assert f"automos_segmented/log holds the results of {log}, another recording of that name" in error
    assert len(list(Path("automos_segmented/log/predictions").iterdir())) == 5
    assert automos("segment", log)[0] == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--method", "magic"), "there is no method 'magic': choose evidence or lmnet"),
        (("--method", "evidence", "--weights", "none.pt"), "--engine, --device and --threads are the network's"),
        (("--engine", "torch"), "--engine, --device and --threads are the network's"),
        (("--device", "gpu"), "--engine, --device and --threads are the network's"),
        (("--method", "lmnet", "--lag", "1"), "the network labels each scan immediately"),
        (("--lag=-1",), "lag must be 0 or more seconds"),
    ],
)
def test_options_that_do_not_go_together_are_refused(automos, log, words, message):
    code, _, error = automos("segment", log, *words)
    assert code == 2
    assert message in " ".join(error.split())


@pytest.mark.skipif(not HAS_SHIPPED, reason="no network came along")
def test_a_recording_is_segmented_out_of_the_box(automos, log):
    if not any(find_spec(name) for name in ("openvino", "onnxruntime")):
        pytest.skip("running the network that came along needs OpenVINO or ONNX Runtime: pip install '.[deploy]'")
    code, out, error = automos("segment", log, "--method", "lmnet", "--out", "run")
    assert code == 0, error
    for name in ("000000", "000004"):
        labels = np.fromfile(f"run/predictions/{name}.label", np.uint32)
        assert set(np.unique(labels)) <= {0, 9, 251}
    assert "ms a scan" in out


@pytest.mark.filterwarnings("ignore::UserWarning", "ignore::FutureWarning")
def test_experiments_run_on_recordings_of_ones_own_and_go_on_where_they_were(automos, labelled):
    pytest.importorskip("pytorch_lightning", reason="training needs Lightning: pip install '.[train]'")
    home = [word for part in ("train", "validation", "test") for word in (f"--{part}", labelled)]
    away = [word for part in ("train", "validation", "test") for word in (f"--away-{part}", labelled)]
    # a lane of five scans has no automatic label that moves: what is there of an earlier run is taken
    claim(Path("reproduced"), EXPERIMENT)
    automatic = Path("reproduced") / "labels" / labelled.name
    (automatic / "predictions").mkdir(parents=True)
    for path in (labelled / "labels").iterdir():
        (automatic / "predictions" / path.name).write_bytes(path.read_bytes())
    (automatic / "run.json").write_text("{}")

    options = (*home, "--out", "reproduced", "--device", "cpu", *TINY, "--set", "network.training.samples=4")
    theirs = ("--predictions", f"Theirs={automatic}")
    code, out, error = automos("reproduce", "table2", "--extra", labelled, *theirs, *options)
    assert code == 0, error
    for method in ("all movable classes", "scene-flow threshold", "LMNet + manual", "LMNet + ours + extra"):
        assert f"| {method} |" in out
    assert "| Theirs | 100.0 | 100.0 | 100.0 |" in out
    made = Path("reproduced/networks/manual/best.pt").stat().st_mtime_ns
    code, out, error = automos("reproduce", "table3", *away, *options)
    assert code == 0, error
    assert "| LMNet + ours, fine-tuned |" in out
    assert Path("reproduced/figure3.png").stat().st_size > 1000
    assert {"0", "1"} <= json.loads(Path("reproduced/figure3.json").read_text())["test"].keys()
    assert Path("reproduced/networks/manual/best.pt").stat().st_mtime_ns == made
