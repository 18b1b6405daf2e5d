import math
import time

import pytest
import yaml
from pydantic import BaseModel

from automos.core.errors import SettingsError
from automos.settings import PRESETS, Settings, dump_yaml, load_settings, read_overrides


def leaves(group: type[BaseModel], prefix: str = ""):
    for name, field in group.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from leaves(field.annotation, f"{prefix}{name}.")
        else:
            yield prefix + name, field


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_loads_and_its_dump_is_a_settings_file(preset, tmp_path):
    settings = load_settings(preset)
    (tmp_path / "settings.yaml").write_text(dump_yaml(settings))
    for other in PRESETS:  # a dump is complete: it does not matter what it is read over
        assert load_settings(other, tmp_path / "settings.yaml") == settings


def test_the_preset_named_paper_has_the_values_of_the_paper():
    settings = load_settings("paper")
    hdbscan, association = settings.instances.hdbscan, settings.tracking.association
    assert (hdbscan.epsilons, hdbscan.min_points, hdbscan.max_side) == ((2.0, 1.0, 0.5, 0.25), 5, 20.0)
    assert (association.max_distance, association.max_overlap_cost, association.max_volume_cost) == (2.0, 0.95, 0.7)
    assert settings.tracking.max_misses == 5
    assert settings.candidates.method == "erasor"
    assert settings.instances.method == "hdbscan"


@pytest.mark.parametrize("preset", PRESETS)
def test_changing_one_setting_changes_no_other(preset):
    before = load_settings(preset).model_dump()
    for key, _ in leaves(Settings):
        value = before
        for name in key.split("."):
            value = value[name]
        assert load_settings(preset, overrides={key: value}).model_dump() == before, key


def test_a_file_goes_before_the_preset_and_an_override_before_the_file(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("tracking: {max_misses: 3, association: {max_distance: 4}}\n")
    settings = load_settings("paper", file, {"tracking.association.max_distance": 5.0})
    assert settings.tracking.max_misses == 3
    assert settings.tracking.association.max_distance == 5.0
    assert settings.tracking.association.max_volume_cost == 0.7


@pytest.mark.parametrize("text", ["", "# nothing\n", "{}"])
def test_a_file_that_says_nothing_changes_nothing(tmp_path, text):
    (tmp_path / "mine.yaml").write_text(text)
    assert load_settings("paper", tmp_path / "mine.yaml") == load_settings("paper")


@pytest.mark.parametrize(
    ("key", "near"),
    [
        ("tracking.max_miss", "tracking.max_misses"),
        ("max_misses", "tracking.max_misses"),
        ("tracking.association.max_distence", "tracking.association.max_distance"),
        ("tracking.max_distance", "tracking.association.max_distance"),
        ("candidates.ground.cells", "candidates.ground.cell"),
    ],
)
def test_an_unknown_key_names_the_nearest(key, near):
    with pytest.raises(SettingsError, match=f"no setting '{key}': did you mean '{near}'") as error:
        load_settings("paper", overrides={key: 1})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("key", "instead"),
    [
        ("baselines.yoon.margin", "automos.baselines"),
        ("baselines", "automos.baselines"),
        ("candidates.erasor.voxel", "automos.baselines.erasor"),
        ("network.online.engine", "--engine"),
        ("network.training.optimizer", "network.training.recipe"),
    ],
)
def test_what_is_a_setting_no_more_says_what_to_do_instead(key, instead):
    with pytest.raises(SettingsError, match=f"' is not a setting any more: .*{instead}"):
        load_settings("paper", overrides={key: 1})


def test_an_unknown_group_names_the_nearest_group():
    with pytest.raises(SettingsError, match="no setting 'traking': did you mean 'tracking'"):
        load_settings("paper", overrides={"traking.max_misses": 1})


@pytest.mark.parametrize(
    ("key", "value", "why"),
    [
        ("tracking.max_misses", -1, "greater than or equal to 0"),
        ("tracking.max_misses", 2.5, "integer"),
        ("tracking.max_misses", "many", "integer"),
        ("tracking.max_misses", None, "integer"),
        ("instances.components.min_points", 10**400, "between 1e-06 and 1e\\+09"),
        ("tracking.association.max_distance", 0, "greater than 0"),
        ("tracking.association.max_distance", float("nan"), ""),
        ("tracking.verdict.trajectory", "gross", "'net' or 'accumulated'"),
        ("instances.hdbscan.epsilons", [1.0, 2.0], "decreas"),
        ("instances.hdbscan.epsilons", [1.0, 0.0], ""),
        ("instances.hdbscan.epsilons", [], ""),
        ("candidates.ground", {"cell": 0.001}, "max_range is at most 2000 cells"),
        ("odometry.max_range", True, "it is not a boolean"),
        ("tracking.max_misses", True, "it is not a boolean"),
        ("tracking", 3, ""),
        ("output.track_ids", "perhaps", "boolean"),
    ],
)
def test_a_value_that_is_not_possible_is_told_with_its_key(key, value, why):
    with pytest.raises(SettingsError, match=f"setting {key}.* is not possible: .*{why}") as error:
        load_settings("paper", overrides={key: value})
    assert "\n" not in str(error.value)


def test_an_unknown_preset_names_the_known_ones():
    with pytest.raises(SettingsError, match="no preset 'papre': choose one of paper, default"):
        load_settings("papre")


@pytest.mark.parametrize("text", ["[1, 2]", "just words", "a: [1", "a: b: c", "odometry: {}\nodometry: {}"])
def test_a_file_that_is_no_settings_file_is_told_by_name_in_one_line(tmp_path, text):
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(SettingsError, match=r"mine\.yaml") as error:
        load_settings("paper", tmp_path / "mine.yaml")
    assert "\n" not in str(error.value)


def test_a_file_that_is_not_there_is_told_by_name(tmp_path):
    with pytest.raises(SettingsError, match=r"mine\.yaml could not be read"):
        load_settings("paper", tmp_path / "mine.yaml")


def test_a_file_that_is_no_text_is_told_by_name(tmp_path):
    (tmp_path / "mine.yaml").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(SettingsError, match=r"mine\.yaml"):
        load_settings("paper", tmp_path / "mine.yaml")


def test_names_of_settings_are_unique_within_their_group_and_dumped_in_order():
    dumped = yaml.safe_load(dump_yaml(load_settings("paper")))
    names = []
    for path, _ in leaves(Settings):
        value = dumped
        for key in path.split("."):
            value = value[key]
        names.append(path)
    assert len(names) == len(set(names)) > 50


@pytest.mark.parametrize(
    "text",
    [
        "tracking: {max_misses: -1}",
        "tracking: {max_miss: 3}",
        "tracking: 3",
        "candidates: {free_space: {longest_span: .inf}}",
    ],
)
def test_a_value_in_a_file_that_is_not_possible_is_told_with_the_file(tmp_path, text):
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(SettingsError, match=r"^settings file .*mine\.yaml: .*setting '?(tracking|candidates)") as error:
        load_settings("paper", tmp_path / "mine.yaml")
    assert "\n" not in str(error.value)


def test_a_value_of_the_command_line_is_not_put_down_to_the_file(tmp_path):
    (tmp_path / "mine.yaml").write_text("tracking: {max_misses: 3}")
    with pytest.raises(SettingsError, match=r"^setting tracking\.max_misses = -1 is not possible"):
        load_settings("paper", tmp_path / "mine.yaml", {"tracking.max_misses": -1})


@pytest.mark.parametrize(
    ("text", "value"),
    [("010", 10), ("1:30", "1:30"), ("yes", "yes"), ("0x10", "0x10"), ("1_000", "1_000"), ("2001-01-01", "2001-01-01"),
     ("1e3", 1000.0), (".5", 0.5), ("-.inf", -math.inf), ("True", True), ("~", None), ("'010'", "010"), ("-7", -7)],
)  # fmt: skip
def test_values_are_what_they_look_like(text, value):
    (found,) = read_overrides([f"tracking.max_misses={text}"]).values()
    assert (found, type(found)) == (value, type(value))


def test_numbers_of_earlier_yaml_are_no_other_numbers():
    with pytest.raises(SettingsError, match=r"tracking.max_misses = '1:30' is not possible"):
        load_settings(overrides=read_overrides(["tracking.max_misses=1:30"]))
    assert load_settings(overrides=read_overrides(["tracking.max_misses=010"])).tracking.max_misses == 10


def test_megabytes_of_yaml_are_told_at_once(tmp_path):
    (tmp_path / "mine.yaml").write_text("[" + "1," * 15_000_000 + "]")
    start = time.process_time()
    with pytest.raises(SettingsError, match=r"is not YAML \(it has 30,000,002 letters, more than anything of its kind"):
        load_settings("default", tmp_path / "mine.yaml")
    assert time.process_time() - start < 5.0
