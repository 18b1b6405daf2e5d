"""What is given from Python in the wrong place is told in a sentence, before any work."""

import math
from pathlib import Path

import numpy as np
import pytest

import automos
from automos.core.errors import AutomosError
from automos.writers import export_run

SCANS = [np.random.default_rng(0).uniform(-20.0, 20.0, (300, 3))] * 2


@pytest.mark.parametrize(
    "place", ["\0", "a\0b", 5, b"x", ["a"], math.nan, "x" * 5000], ids=lambda place: repr(place)[:9]
)
@pytest.mark.parametrize(
    "take",
    [
        automos.Workspace,
        automos.open_sequence,
        automos.open_recordings,
        automos.open_run,
        lambda place: automos.load_settings("default", place),
        lambda place: export_run(place, [automos.ArraySequence(SCANS)], "ply"),
    ],
    ids=["Workspace", "open_sequence", "open_recordings", "open_run", "load_settings", "export_run"],
)
def test_a_path_that_is_none_is_told(take, place):
    with pytest.raises(AutomosError, match=r"(is not a path|cannot be used) \(.*\): give ") as error:
        take(place)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("value", [5, "paper", ["a"], Path("run"), math.nan], ids=lambda value: type(value).__name__)
@pytest.mark.parametrize(
    ("take", "remedy"),
    [
        (lambda value: automos.label(SCANS, value), r"automos\.load_settings returns"),
        (lambda value: automos.Labeler(value), r"automos\.load_settings returns"),
        (lambda value: automos.label(SCANS, workspace=value), r"give automos\.Workspace\(folder\)"),
        (lambda value: automos.label(SCANS, progress=value), "give a function"),
        (lambda value: automos.load_settings("default", None, value), "give names and values"),
        (lambda value: automos.write_report(value, "report.html"), r"automos\.load returns"),
    ],
    ids=["label", "Labeler", "workspace", "progress", "overrides", "write_report"],
)
def test_something_else_than_is_meant_is_told_with_what_to_give(take, remedy, value):
    with pytest.raises(AutomosError, match=remedy):
        take(value)


def test_recordings_and_formats_of_an_export_that_are_none_are_told(tmp_path):
    for sequences in (5, None, automos.ArraySequence(SCANS)):
        with pytest.raises(AutomosError, match="give a list of the recordings"):
            export_run(tmp_path, sequences, "ply")
    for sequences in ([5], [tmp_path], ["recording"]):
        with pytest.raises(AutomosError):
            export_run(tmp_path, sequences, "ply")
    with pytest.raises(AutomosError, match="give one of semantickitti"):
        export_run(tmp_path, [automos.ArraySequence(SCANS)], None)


def test_scans_that_cannot_be_counted_are_told():
    with pytest.raises(AutomosError, match="give a list with an array for each scan"):
        automos.ArraySequence(5)
    with pytest.raises(AutomosError, match="the name of a sequence is 5, of type int: give a text"):
        automos.ArraySequence(SCANS, name=5)


def test_what_is_told_is_one_line_whatever_it_shows():
    with pytest.raises(AutomosError) as error:
        automos.Labeler(threads=np.zeros((9, 3)))
    assert "\n" not in str(error.value)
    with pytest.raises(AutomosError, match="is_compensated is"):
        automos.Labeler(is_compensated="yes")
    with pytest.raises(AutomosError, match="is_compensated is"):
        automos.ArraySequence(SCANS, is_compensated=np.zeros(3))
