"""Settings files of earlier versions: results hold all settings of theirs, a user's own file some."""

import logging

import pytest
import yaml

from automos.core.errors import SettingsError
from automos.settings import Settings, dump_yaml, keys_of, load_settings
from automos.settings.former import BECAME, RENAMED


@pytest.fixture
def earlier(tmp_path):
    """Return a file as results of an earlier version hold it."""
    tree = yaml.safe_load(dump_yaml(load_settings(overrides={"recording.rates": {"log_1": 5.0}})))
    tree["odometry"] |= {"voxel": 0.7, "refinement": {"max_speed": 30.0, "surfel": 0.4, "kernels": [0.5, 0.1]}}
    del tree["odometry"]["max_speed"], tree["map"]["loops"]["min_distance"], tree["map"]["loop_closure"]
    tree["odometry"] |= {"loop_closure": True, "loops": {"min_way": 70.0}}
    tree |= {"baselines": {"octomap": {"batch": {"scans": 9}, "hit": 0.7}}}
    (tmp_path / "settings.yaml").write_text(yaml.safe_dump(tree))
    return tmp_path / "settings.yaml"


def test_results_of_an_earlier_version_still_say_what_can_be_said(earlier, caplog):
    with caplog.at_level(logging.WARNING):
        settings = load_settings("default", earlier)
    assert settings.odometry.max_speed == 30.0
    assert (settings.map.loop_closure, settings.map.loops.min_distance) == (True, 70.0)
    assert settings.recording.rates == {"log_1": 5.0}
    (record,) = caplog.records
    assert "settings.yaml: " in record.getMessage()
    assert record.getMessage().endswith(" and 4 more are left out: they are constants now, not settings")


def test_a_present_name_goes_before_a_former_one(tmp_path):
    (tmp_path / "mine.yaml").write_text("odometry: {max_speed: 20.0, refinement: {max_speed: 30.0}}")
    assert load_settings("default", tmp_path / "mine.yaml").odometry.max_speed == 20.0


def test_a_former_name_that_is_asked_for_is_an_error(tmp_path):
    with pytest.raises(SettingsError, match=r"it is called 'odometry\.max_speed' now"):
        load_settings(overrides={"odometry.refinement.max_speed": 0.3})
    (tmp_path / "mine.yaml").write_text("odometry: {voxel: 0.7}")
    with pytest.raises(SettingsError, match=r"mine\.yaml: there is no setting 'odometry.voxel'"):
        load_settings("default", tmp_path / "mine.yaml")


def test_no_former_name_is_a_present_one():
    present = set(keys_of(Settings))
    assert not present & {*RENAMED, *BECAME}
    assert set(RENAMED.values()) <= present
