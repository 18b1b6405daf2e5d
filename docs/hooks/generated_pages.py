"""Pages of the docs that the code writes itself: commands and their options, settings and their ranges, benchmarks."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

sys.path.insert(0, str(Path(__file__).parents[2] / "src"))
sys.path.insert(1, str(Path(__file__).parents[2] / "benchmarks"))

import typer
from catalog import BENCHMARKS
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from automos.cli import app
from automos.settings import PRESETS, Settings, load_settings


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages to those on disk."""
    for page in (commands_page, settings_page, benchmarks_page):
        name = page.__name__.removesuffix("_page")
        files.append(File.generated(config, f"reference/{name}.md", content=page()))
    return files


# ------------------------------------------------------------------------------------------------------- settings
def settings_page() -> str:
    """Return a table of every group of settings: value, range and meaning of each."""
    presets = {name: load_settings(name) for name in PRESETS}
    lines = [
        "# Settings",
        "",
        "The numbers that a user may want to change. `automos settings` prints them as YAML, `--settings FILE` reads",
        "such a file, `--set labels.unsure=0.7` changes one. Values are those of preset `default`; where `paper` has",
        "another, it is named.",
        "",
    ]
    for prefix, group in _groups(Settings):
        rows = [
            _row(f"`{name}`", _value(presets, prefix + name), _range(field), field.description or "")
            for name, field in group.model_fields.items()
            if not _is_group(field.annotation)
        ]
        if rows:
            title = prefix.rstrip(".")
            lines += [
                f"## {title}",
                "",
                _first(group.__doc__),
                "",
                "| setting | value | range | meaning |",
                "|---|---|---|---|",
            ]
            lines += [*rows, ""]
    return "\n".join(lines)


def _groups(group: type[BaseModel], prefix: str = "") -> list[tuple[str, type[BaseModel]]]:
    found = [(prefix, group)]
    for name, field in group.model_fields.items():
        if _is_group(field.annotation):
            found += _groups(field.annotation, f"{prefix}{name}.")
    return found


def _is_group(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _value(presets: dict[str, Settings], key: str) -> str:
    def of(settings: Any) -> Any:
        for part in key.split("."):
            settings = getattr(settings, part)
        return settings

    default, paper = of(presets["default"]), of(presets["paper"])
    return f"`{default}`" if default == paper else f"`{default}`; paper: `{paper}`"


def _range(field: FieldInfo) -> str:
    annotation = field.annotation
    choices = [
        choice
        for part in (annotation, *get_args(annotation))
        if get_origin(part) is Literal
        for choice in get_args(part)
    ]
    if choices:
        return " or ".join(f"`{choice}`" for choice in choices)
    signs = {"gt": "&gt;", "ge": "&ge;", "lt": "&lt;", "le": "&le;"}
    bounds = [
        f"{signs[key]} {getattr(m, key)}" for m in field.metadata for key in signs if getattr(m, key, None) is not None
    ]
    return "yes or no" if annotation is bool else ", ".join(bounds)


def _row(*cells: str) -> str:
    return "| " + " | ".join(" ".join(cell.split()).replace("|", "\\|") for cell in cells) + " |"


def _first(docstring: str | None) -> str:
    return " ".join((docstring or "").strip().split("\n\n")[0].split())


# ------------------------------------------------------------------------------------------------------- commands
def commands_page() -> str:
    """Return every command with what it does, its examples, arguments and options."""
    group = typer.main.get_command(app)
    lines = ["# Commands", "", "`automos COMMAND --help` says the same.", ""]
    for name, command in sorted(group.commands.items()):
        lines += [f"## automos {name}", "", *_help(command.help or ""), ""]
        rows = [_parameter(parameter) for parameter in command.params if parameter.name != "help"]
        lines += ["| | | |", "|---|---|---|", *rows, ""]
    return "\n".join(lines)


def _help(text: str) -> list[str]:
    """Return help as paragraphs; those that start with the program's name are examples."""
    lines: list[str] = []
    for paragraph in re.sub(r"\[/?bold\]", "**", text).split("\n\n"):
        words = paragraph.strip()
        lines += ["```sh", words, "```", ""] if words.startswith("automos ") else [" ".join(words.split()), ""]
    return lines


def _parameter(parameter: Any) -> str:
    is_option = parameter.param_type_name == "option"
    names = ", ".join(f"`{name}`" for name in (*parameter.opts, *parameter.secondary_opts)) if is_option else ""
    shown = names or f"`{(parameter.metavar or parameter.name).upper()}`"
    default = parameter.default
    has_default = default not in (None, False, ()) and isinstance(default, (str, int, float, Path))
    return _row(shown, getattr(parameter, "help", None) or "", f"default `{default}`" if has_default else "")


# ----------------------------------------------------------------------------------------------------- benchmarks
def benchmarks_page() -> str:
    """Return a table of every benchmark: what it measures, and how long that takes on two cores."""
    rows = [_row(f"`{name}`", benchmark.what, benchmark.takes) for name, benchmark in BENCHMARKS.items()]
    heading = ["# List of benchmarks", "", "| name | what it measures | takes about |", "|---|---|---|"]
    return "\n".join([*heading, *rows, ""])
