"""Settings of a run: a preset, changed by a settings file, then by the command line; and their YAML form.

The preset "paper" follows the paper; "default" is the most accurate one.
"""

import difflib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError

from automos.core.arguments import require_kind
from automos.core.errors import SettingsError
from automos.core.reading import YamlDumper, given_path, parse_yaml, read_text
from automos.settings.former import refuse_former_name, with_present_names
from automos.settings.tree import Settings

PRESETS: dict[str, dict[str, Any]] = {
    "paper": {
        "candidates": {"method": "erasor"},
        "instances": {"method": "hdbscan"},
        "tracking": {
            "method": "paper",
            "filter": {  # AB3DMOT's, converted from 0.1 s frames to seconds
                "initial_variance": 10.0,
                "initial_velocity_variance": 1e6,
                "process_variance": 10.0,
                "process_velocity_variance": 10.0,
                "measurement_variance": 1.0,
            },
            "max_misses": 5,
            "max_gap": 0.0,
        },
    },
    "default": {},
}


def load_settings(
    preset: str = "default", file: str | Path | None = None, overrides: Mapping[str, Any] | None = None
) -> Settings:
    """Return the settings of a preset, changed by a file and then by single values.

    Parameters
    ----------
    preset : {"default", "paper"}
        The settings to start from.
    file : str or Path, optional
        YAML file with the settings to change, as `automos settings` prints them.
    overrides : mapping of str to value, optional
        Single settings to change, by their dotted names.

    Returns
    -------
    Settings
        The checked settings.

    Raises
    ------
    SettingsError
        The preset or a name is unknown (the message suggests the nearest one), or a value has the wrong type or is
        out of range.

    Examples
    --------
    >>> import automos
    >>> settings = automos.load_settings("paper", overrides={"tracking.max_misses": 3})
    >>> settings.tracking.max_misses
    3
    """
    require_kind(preset, str, "preset", f"one of {', '.join(PRESETS)}")
    if preset not in PRESETS:
        raise SettingsError(f"there is no preset '{preset}': choose one of {', '.join(PRESETS)}")
    tree = _merged(Settings().model_dump(), PRESETS[preset])  # defaults of one group may differ by parent
    of_file = {} if file is None else _read_yaml(given_path(file, "a settings file"))
    of_overrides: dict[str, Any] = {}
    tree = _merged(tree, of_file)
    overrides = {} if overrides is None else overrides
    require_kind(overrides, Mapping, "overrides", 'names and values, {"tracking.max_misses": 3}')
    for dotted, value in overrides.items():
        refuse_former_name(dotted)
        branch: Any = value
        for key in reversed(dotted.split(".")):
            branch = {key: branch}
        tree, of_overrides = _merged(tree, branch), _merged(of_overrides, branch)
    try:
        return Settings.model_validate(tree)
    except ValidationError as error:
        path = [str(part) for part in error.errors()[0]["loc"]]
        is_of_file = _holds(of_file, path) and not _holds(of_overrides, path)
        raise SettingsError(f"settings file {file}: {_sentence(error)}" if is_of_file else _sentence(error)) from None


def read_overrides(items: Iterable[str] | None) -> dict[str, Any]:
    """Return the values of settings written as "tracking.max_misses=3", by name; values are in YAML.

    Raises
    ------
    SettingsError : a value is missing or not valid YAML.
    """
    values = {}
    for item in items or []:
        key, sign, text = item.partition("=")
        if not sign:
            raise SettingsError(f"--set {item} has no value: write --set {key}=VALUE")
        try:
            values[key.strip()] = parse_yaml(text)
        except ValueError:
            raise SettingsError(
                f"--set {item}: '{text}' is not a value: write a number, a word or a list, [1, 2]"
            ) from None
    return values


def dump_yaml(settings: Settings) -> str:
    """Return settings as YAML text that `load_settings` reads back.

    Parameters
    ----------
    settings : Settings
        The settings to write.

    Returns
    -------
    str
        YAML, one setting per line.
    """
    return yaml.dump(settings.model_dump(mode="json"), Dumper=YamlDumper, sort_keys=False)


def keys_of(group: type[BaseModel], prefix: str = "") -> list[str]:
    """Return the names of the settings and groups in `group`, at any depth ("tracking.max_misses"), after `prefix`."""
    keys = []
    for name, field in group.model_fields.items():
        keys.append(prefix + name)
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            keys += keys_of(field.annotation, f"{prefix}{name}.")
    return keys


def _merged(base: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    out = dict(base)
    for key, value in change.items():
        is_group = isinstance(value, Mapping) and isinstance(out.get(key, {}), Mapping)
        out[key] = _merged(out.get(key, {}), value) if is_group else value
    return out


def _holds(tree: Any, path: list[str]) -> bool:
    """Return whether `tree` has a value at `path`, or for the group or list that contains it."""
    for key in path:
        if not isinstance(tree, Mapping):
            return True
        if key not in tree:
            return False
        tree = tree[key]
    return True


def _read_yaml(file: Path) -> dict[str, Any]:
    try:
        tree = parse_yaml(read_text(file))
    except OSError as error:
        raise SettingsError(f"settings file {file} could not be read ({error.strerror}): check the path") from None
    except ValueError as error:  # not text, invalid date, endless nesting
        raise SettingsError(f"settings file {file} is not YAML ({error}): `automos settings` prints one") from None
    if not isinstance(tree, dict | None):
        raise SettingsError(f"settings file {file} must hold names and values: `automos settings` prints one")
    return with_present_names(tree or {}, set(keys_of(Settings)), f"settings file {file}")


def _sentence(error: ValidationError) -> str:
    """Return the first problem of `error` as a sentence with the key, the value and the nearest known key."""
    problem = error.errors()[0]
    path = [str(part) for part in problem["loc"]]
    key = ".".join(path)
    if problem["type"] == "extra_forbidden":
        known = keys_of(Settings)
        same_name = [k for k in known if (k.split(".")[0], k.rsplit(".", 1)[-1]) == (path[0], path[-1])]
        near = difflib.get_close_matches(key, same_name or known, 1, 0.0)[0]
        return f"there is no setting '{key}': did you mean '{near}'? (`automos settings` lists all)"
    return (
        f"setting {key} = {problem['input']!r} is not possible: {problem['msg'].removeprefix('Value error, ').lower()}"
    )
