"""Scene flow as other programs read it."""

import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_run import INSTANCES, LABELS, STAMPS, T_LEVEL_WORLD, T_WORLD_SENSOR, VELOCITY, export, make_run, make_scans

from automos.core.geometry import inverse, transform
from automos.writers.flow import scan_flow, timestamps

NANOSECONDS = [str(1000 * round(1e6 * stamp)) for stamp in STAMPS]


@pytest.fixture
def run(tmp_path):
    """Return a run of three scans."""
    return make_run(tmp_path / "run")


def test_a_point_moves_as_its_track_does_and_the_rest_as_the_sensor_sees_it(run):
    found, points = scan_flow(run, 0), run.scan(0).points
    # Track 2 drives with VELOCITY in the level frame for a tenth of a second
    level = transform(T_LEVEL_WORLD @ T_WORLD_SENSOR[0], points)
    level[np.array(INSTANCES[0]) == 2] += 0.1 * np.array(VELOCITY)
    expected = transform(inverse(T_LEVEL_WORLD @ T_WORLD_SENSOR[1]), level)
    assert points + found.flow == pytest.approx(expected, abs=1e-4)
    assert found.is_dynamic.tolist() == [False, True, True, False, False, False]
    assert found.is_known.tolist() == [True, True, True, False, True, False]  # no label; moving, but on no track


def test_argoverse_reads_a_row_per_point_of_every_sweep_but_the_last(run, tmp_path):
    feather = pytest.importorskip("pyarrow.feather", reason="reading needs pyarrow: pip install '.[flow]'")
    out = export(run, "flow-av2", tmp_path / "flow")
    files = sorted((out / "street").glob("*.feather"))
    assert [file.stem for file in files] == NANOSECONDS[:-1]
    table = feather.read_table(files[0])
    assert [str(field.type) for field in table.schema] == ["halffloat"] * 3 + ["bool"]
    flow = np.column_stack([table[f"flow_t{axis}_m"].to_numpy() for axis in "xyz"])
    assert flow == pytest.approx(scan_flow(run, 0).flow, abs=5e-3)
    assert table["is_dynamic"].to_pylist() == scan_flow(run, 0).is_dynamic.tolist()


def test_argoverses_own_evaluation_reads_it_and_finds_the_same_error(run, tmp_path):
    evaluation = pytest.importorskip(
        "av2.evaluation.scene_flow.eval",
        reason="Argoverse's own programs are not installed: pip install '.[dev-readers]'",
    )
    import pandas

    out = export(run, "flow-av2", tmp_path / "flow")
    found = scan_flow(run, 0)
    off = np.array([0.3, 0.4, 0.0])  # half a metre
    truth = pandas.DataFrame((found.flow + off).astype(np.float16), columns=["flow_tx_m", "flow_ty_m", "flow_tz_m"])
    truth = truth.assign(category_indices=np.uint8(0), is_dynamic=found.is_dynamic, is_close=True, is_valid=True)
    (tmp_path / "truth" / "street").mkdir(parents=True)
    truth.to_feather(tmp_path / "truth" / "street" / f"{NANOSECONDS[0]}.feather")
    scores = evaluation.evaluate_directories(tmp_path / "truth", out)
    there = scores[scores["Count"] > 0]
    assert there["Count"].sum() == len(found.own)
    assert there["EPE"].to_numpy(float) == pytest.approx(0.5, abs=0.01)
    assert there[["FP", "FN"]].to_numpy().sum() == 0


def test_opensceneflow_finds_all_that_its_loader_asks_for(run, tmp_path):
    h5py = pytest.importorskip("h5py", reason="reading needs h5py: pip install '.[flow]'")
    out = export(run, "opensceneflow", tmp_path / "h5")
    index = pickle.loads((out / "index_total.pkl").read_bytes())
    assert index == [["street", stamp] for stamp in NANOSECONDS]
    assert pickle.loads((out / "index_flow.pkl").read_bytes()) == index[:-1]
    with h5py.File(out / "street.h5") as file:
        assert sorted(file, key=int) == NANOSECONDS
        for (_, stamp), scan in zip(index, run.sequence, strict=True):
            group = file[stamp]
            n_points = int(scan.is_valid.sum())
            assert group["lidar"].shape == (n_points, 4)
            assert np.isfinite(group["lidar"][:]).all()
            assert group["ground_mask"].dtype == bool
            assert {group[name].shape for name in ("ground_mask", "dufo", "dufocluster")} == {(n_points,)}
            assert group["pose"].shape == (4, 4)
            assert ("flow" in group) == (stamp != NANOSECONDS[-1])
        first, second = file[NANOSECONDS[0]], file[NANOSECONDS[1]]
        ego = np.linalg.inv(second["pose"][:]) @ first["pose"][:]  # as its loader computes it
        assert first["ego_motion"][:] == pytest.approx(ego, abs=1e-5)
        still = np.array(INSTANCES[0]) == 0
        moved = first["lidar"][:, :3] @ ego[:3, :3].T + ego[:3, 3] - first["lidar"][:, :3]
        assert first["flow"][:][still] == pytest.approx(moved[still], abs=1e-4)
        assert first["flow_is_valid"][:].tolist() == scan_flow(run, 0).is_known.tolist()
        assert first["dufo"][:].tolist() == [int(label == 251) for label in LABELS[0]]
        assert first["dufocluster"][:].tolist() == [int(track > 0) for track in INSTANCES[0]]
        assert first["flow_category_indices"][:].tolist() == [19 * (track > 0) for track in INSTANCES[0]]


def test_opensceneflow_finds_the_last_scan_although_it_compares_times_as_text(run, tmp_path, monkeypatch):
    h5py = pytest.importorskip("h5py", reason="reading needs h5py: pip install '.[flow]'")
    monkeypatch.setattr("automos.writers.flow.timestamps", lambda run: ["0", "900000000", "1000000000"])
    out = export(run, "opensceneflow", tmp_path / "h5")
    times = [stamp for _, stamp in pickle.loads((out / "index_total.pkl").read_bytes())]
    assert times == sorted(times) == ["0000000000", "0900000000", "1000000000"]
    with h5py.File(out / "street.h5") as file:
        assert list(file) == times


def test_a_full_disk_is_a_sentence_for_opensceneflow_too(run, tmp_path):
    pytest.importorskip("h5py", reason="writing needs h5py: pip install '.[flow]'")
    pytest.importorskip("resource", reason="Windows limits no file")
    script = (
        "import resource, sys; from pathlib import Path; sys.path.insert(0, sys.argv[1])\n"
        "from made_run import export, make_run; from automos.core.errors import InputError\n"
        "run = make_run(Path(sys.argv[2]) / 'run')\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500))\n"
        "try: export(run, 'opensceneflow', Path(sys.argv[2]) / 'flow')\n"
        "except InputError as error: print(error)\n"
    )
    words = [sys.executable, "-c", script, str(Path(__file__).parent.parent), str(tmp_path / "limited")]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    assert "street.h5 could not be written" in done.stdout
    assert {path.name for path in (tmp_path / "limited" / "flow").iterdir()} <= {".automos"}


def test_names_that_count_microseconds_are_written_as_nanoseconds(tmp_path):
    scans = make_scans()
    for scan, stamp in zip(scans, STAMPS, strict=True):
        object.__setattr__(scan, "name", str(round(1e6 * stamp)))  # as Waymo's are
    assert timestamps(make_run(tmp_path / "run", scans=scans)) == NANOSECONDS
    for scan, nanoseconds in zip(scans, NANOSECONDS, strict=True):
        object.__setattr__(scan, "name", nanoseconds)
    assert timestamps(make_run(tmp_path / "again", scans=scans)) == NANOSECONDS


def test_opensceneflow_gets_ids_above_zero_of_whatever_tracks(run, tmp_path, monkeypatch):
    h5py = pytest.importorskip("h5py")
    ids = np.array([0, 1, 32767, 32768, 65536, 70000])
    monkeypatch.setattr("automos.writers.flow.scan_flow", lambda run, k: replace(scan_flow(run, k), instances=ids))
    with h5py.File(export(run, "opensceneflow", tmp_path / "out") / "street.h5") as file:
        assert file[NANOSECONDS[0]]["flow_instance_id"][:].tolist() == [0, 1, 32767, 1, 2, 4466]
