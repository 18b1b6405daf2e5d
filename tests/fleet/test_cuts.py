"""Recordings cut into units and not, with one worker and with two: the same labels, byte for byte."""

from pathlib import Path

import pytest
from small_fleet import N_SCANS, result_files, write_recording

from automos.fleet.label import Resources, label_fleet
from automos.fleet.local_pool import Executor, InProcess, LocalPool
from automos.fleet.sources import find_all
from automos.fleet.status import read_status
from automos.settings import Settings, load_settings
from automos.simulation import SCENARIOS, simulate, write


@pytest.fixture
def label(tmp_path):
    """Return a function that labels a folder of recordings, and returns their result files and their units."""

    def label(logs: Path, out: str, settings: Settings, executor: Executor, chunk: int):
        resources, found = Resources(work=tmp_path / "work", chunk=chunk), find_all(str(logs))
        outcome = label_fleet(found, str(tmp_path / out), settings, resources, executor=lambda resources: executor)
        assert outcome.failed == {}
        units = {unit["unit"] for unit in read_status(str(tmp_path / out)).units}
        return {name: result_files(tmp_path / out / name) for name in sorted(outcome.labelled)}, units

    return label


@pytest.mark.slow
def test_submaps_of_erasor_reach_beyond_the_units(label, tmp_path):
    settings = load_settings("paper")
    write_recording(tmp_path / "logs" / "lane", seed=0)
    whole, _ = label(tmp_path / "logs", "whole", settings, InProcess(), chunk=600)
    cut, units = label(tmp_path / "logs", "cut", settings, InProcess(), chunk=5)
    assert {"evidence 0:5", "evidence 10:12", "tracks", "labels 5:10", "results"} <= units
    assert all(sum(path.endswith(".label") for path in files) == N_SCANS for files in whole.values())
    assert cut == whole


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    """Return a folder with sixteen scans of every scenario."""
    root = tmp_path_factory.mktemp("suite")
    for scenario in SCENARIOS:
        write(simulate(scenario, "VLP-16", 16, seed=0), root / scenario, workers=2)
    return root


@pytest.mark.slow
@pytest.mark.parametrize(
    ("preset", "values"),
    [("default", {}), ("paper", {}), ("default", {"labels.moving": "now", "output.confidence": True})],
    ids=["default", "paper", "moving now, with confidences"],
)
def test_on_the_scenario_suite_neither_cuts_nor_workers_change_a_byte(suite, label, preset, values):
    settings = load_settings(preset, overrides=values)
    whole, units = label(suite, "whole", settings, InProcess(), chunk=600)
    assert (sorted(whole), units) == (sorted(SCENARIOS), {"start"})
    cut, units = label(suite, "cut", settings, LocalPool(2, 2), chunk=5)
    assert {"evidence 0:5", "evidence 15:16", "tracks", "labels 5:10", "results"} <= units
    assert [name for name in SCENARIOS if cut[name] != whole[name]] == []
