import json

import numpy as np
import pytest

from automos.evaluation.moving import Counts
from automos.network.domains import DOMAINS, Part, write_part
from automos.network.experiments import SIZES, SMALL, TUNING
from automos.network.tables import Curves, Row, write_curves, write_table
from automos.settings import load_settings
from automos.simulation import SCENARIOS, SENSORS


def test_no_world_serves_two_purposes():
    for domain in DOMAINS.values():
        parts = (domain.train, domain.extra, domain.validation, domain.test)
        worlds = [world for part in parts for world in part.worlds]
        assert len(worlds) == len(set(worlds))
        assert all(scenario in SCENARIOS and sensor in SENSORS for scenario, sensor, _ in worlds)
        assert all(seed >= 10 for *_, seed in worlds)  # those below chose the labeler's settings
    sensors = [{sensor for _, sensor, _ in DOMAINS[name].train.worlds} for name in "KA"]
    assert not sensors[0] & sensors[1]


def test_the_settings_of_the_experiments_exist():
    assert load_settings("default", overrides={**SMALL, **TUNING}).network.model.channels == 8
    for channels, sizes in zip((8, 32), zip(*SIZES.values(), strict=True), strict=True):
        assert all(load_settings("default", overrides=size).network.model.channels == channels for size in sizes)


def test_parts_are_written_once(tmp_path):
    part = Part((("waiting", "VLP-16", 30),), 2)
    first = write_part(part, tmp_path, workers=1)
    times = [path.stat().st_mtime_ns for path in sorted(tmp_path.rglob("*.bin"))]
    assert len(times) == 2
    assert write_part(part, tmp_path, workers=1)[0].fingerprint() == first[0].fingerprint()
    assert [path.stat().st_mtime_ns for path in sorted(tmp_path.rglob("*.bin"))] == times


def test_a_table_pools_points_and_is_kept_as_json(tmp_path):
    confusion = np.zeros_like(Counts().confusion)
    confusion[0, 2, 2], confusion[0, 1, 2], confusion[1, 2, 1] = 6, 2, 4  # TD, FD, FS
    text = write_table([Row("network", Counts(confusion, 1), hours=0.25)], tmp_path / "table.json")
    assert "| network | 50.0 | 75.0 | 60.0 | 0.25 |" in text
    assert json.loads((tmp_path / "table.json").read_text())[0]["iou"] == pytest.approx(0.5)


def test_curves_are_drawn_and_their_values_kept(tmp_path):
    validation = {"fine-tuned": [0.1, 0.5], "retrained": [0.0, 0.3, 0.4]}
    write_curves(Curves(validation, {0: 0.2, 1: 0.6}, 0.4), tmp_path / "curves.png")
    assert (tmp_path / "curves.png").stat().st_size > 1000
    assert json.loads((tmp_path / "curves.json").read_text())["test"] == {"0": 0.2, "1": 0.6}
