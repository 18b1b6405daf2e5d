"""Settings files of earlier versions."""

import logging

import pytest

from automos.core.errors import SettingsError
from automos.settings import Settings, keys_of, load_settings
from automos.settings.former import CONSTANTS, RENAMED

EARLIER = """
odometry:
  voxel: 0.7
  convergence: 0.001
  threads: 2
  refinement: {max_speed: 30.0, surfel: 0.4, kernels: [0.5, 0.1]}
  loops: {min_way: 70.0, rings: 20}
"""


@pytest.fixture
def earlier(tmp_path):
    (tmp_path / "settings.yaml").write_text(EARLIER)
    return tmp_path / "settings.yaml"


def test_a_file_of_an_earlier_version_still_says_what_can_be_said(earlier):
    odometry = load_settings("default", earlier).odometry
    assert (odometry.max_speed, odometry.loops.min_distance) == (30.0, 70.0)


def test_what_is_a_constant_now_is_told_in_one_sentence(earlier, caplog):
    with caplog.at_level(logging.WARNING):
        load_settings("default", earlier)
    (record,) = caplog.records
    assert record.getMessage().endswith(
        "settings.yaml: odometry.voxel and 5 more are left out: they are constants now, not settings"
    )


def test_a_present_name_goes_before_a_former_one(tmp_path):
    (tmp_path / "mine.yaml").write_text("odometry: {max_speed: 20.0, refinement: {max_speed: 30.0}}")
    assert load_settings("default", tmp_path / "mine.yaml").odometry.max_speed == 20.0


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("odometry.refinement.surfel", "odometry.refinement.surfel is a constant now"),
        ("odometry.refinement.max_speed", "it is called 'odometry.max_speed' now"),
    ],
)
def test_a_former_name_that_is_asked_for_is_an_error_that_says_what_became_of_it(key, told):
    with pytest.raises(SettingsError, match=told):
        load_settings(overrides={key: 0.3})


def test_no_former_name_is_a_present_one():
    present = set(keys_of(Settings))
    former = {f"{group}.{name}" for group, names in CONSTANTS.items() for name in names.split()} | set(RENAMED)
    assert not present & former
    assert set(RENAMED.values()) <= present


def test_whole_groups_that_are_gone_are_left_out_of_files_and_told_to_who_asks_for_them(tmp_path, caplog):
    file = tmp_path / "settings.yaml"
    file.write_text("baselines: {octomap: {batch: {scans: 9}, hit: 0.7}}\nnetwork: {online: {engine: auto}}\n")
    assert load_settings("default", file) == load_settings("default")
    assert "1 more are left out: they are constants now" in caplog.text
    with pytest.raises(SettingsError, match="not a setting any more: give automos segment its --engine"):
        load_settings("default", None, {"network.online.engine": "torch"})
