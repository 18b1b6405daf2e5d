"""The tables of README and docs show what is stored, and nothing else."""

import argparse
import importlib
import subprocess
import sys
import threading
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
import ablation
import jobs
import rows
import scores
import tables


def stored(iou: float, is_quick: bool = False) -> dict:
    method = {"title": "X", "iou": iou, "precision": 1.0, "recall": iou, "true_dynamic": 1, "false_static": 0}
    result = {"drive": {"n_scans": 2, "methods": {"paper": method, "default": method}}}
    return {"commit": "abc", "date": "2026-01-01", "is_quick": is_quick, "result": result}


@pytest.mark.parametrize("page", tables.pages(), ids=lambda page: page.name)
def test_a_page_shows_the_stored_results(page):
    text = page.read_text()
    assert set(tables.names_in(text)) <= {*tables.TABLES, tables.OVERVIEW}
    assert text.count("<!-- table ") == text.count("<!-- end -->") == len(list(tables.names_in(text)))
    results = {name: found for name in jobs.JOBS if (found := tables.read_result(name)) is not None}
    assert tables.with_tables(text, results) == text, "run python benchmarks/all.py --write"


def test_the_readme_leads_with_stored_figures():
    names = list(tables.names_in((tables.ROOT / "README.md").read_text()))
    assert "presets-drive" in names
    needed = {job for name in names for job in tables.TABLES[name][0]}
    assert [job for job in needed if tables.read_result(job) is None] == []


def test_every_table_has_jobs_and_every_job_a_table():
    assert {job for made_of, _ in tables.TABLES.values() for job in made_of} == set(jobs.JOBS)


def test_every_table_stands_on_a_page_or_was_never_run():
    shown = {name for page in tables.pages() for name in tables.names_in(page.read_text())}
    made = {name for name, (made_of, _) in tables.TABLES.items() if all(map(tables.read_result, made_of))}
    assert made <= shown
    assert tables.OVERVIEW in shown


@pytest.mark.parametrize("job", jobs.JOBS.values(), ids=lambda job: job.name)
def test_a_job_names_a_script_that_takes_its_arguments(job, monkeypatch):
    """Both forms are parsed by the script itself, which then would run."""
    import runpy

    class ParsedError(Exception):
        pass

    def parse(self, *args, **kwargs):
        found, left = self.parse_known_args(*args, **kwargs)
        assert left == []
        raise ParsedError(found)

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse)
    for arguments in (job.arguments, job.quick):
        monkeypatch.setattr(sys, "argv", [job.script, *arguments, "--json", "out.json"])
        with pytest.raises(ParsedError):
            runpy.run_path(str(tables.ROOT / "benchmarks" / job.script), run_name="__main__")


def test_a_figure_that_differs_is_seen():
    page = "Before.\n<!-- table presets-drive -->\n<!-- end -->\nAfter.\n"
    written = tables.with_tables(page, {"presets": stored(0.9)})
    assert "| `default` | 90.0 | 100.0 | 90.0 |" in written
    assert f"`{jobs.JOBS['presets'].command(False)}`, abc, 2026-01-01." in written
    assert written.startswith("Before.\n")
    assert written.endswith("<!-- end -->\nAfter.\n")
    assert tables.with_tables(written, {"presets": stored(0.9)}) == written
    assert tables.with_tables(written, {"presets": stored(0.8)}) != written
    assert tables.with_tables(written, {}) == written  # nothing stored, nothing touched


def test_a_short_form_is_said_to_be_one_and_what_was_not_run_is_named():
    page = "<!-- table presets-drive -->\n<!-- end -->\n<!-- table jobs -->\n<!-- end -->\n"
    written = tables.with_tables(page, {"presets": stored(0.9, is_quick=True)})
    assert f"a part of `{jobs.JOBS['presets'].command(False)}`" in written
    assert "| `presets` | `" in written
    assert "the short form | abc |" in written
    assert "| `suite` | not run: `" in written


def test_a_table_of_worlds_has_the_columns_that_all_its_jobs_have():
    page = "<!-- table methods-worlds -->\n<!-- end -->\n"
    few, more = stored(0.9), stored(0.8)
    more["result"]["other"] = more["result"]["drive"]
    written = tables.with_tables(page, {"worlds-yoon": few, "worlds-presets": more})
    assert "| method | `drive` |" in written
    assert f"{', '.join(f'`worlds-{rival}`' for rival in jobs.RIVALS if rival != 'yoon')} of" in written


def test_a_table_of_many_jobs_shows_those_that_were_run_and_names_the_others():
    cost = {"seconds_per_scan": 1.0, "runs": 1, "cpu_seconds_per_scan": None, "peak_mb": None, "needs_future": True}
    one = stored(0.9)
    one["result"] = {"drive": {"n_scans": 2, "methods": {"yoon": one["result"]["drive"]["methods"]["paper"] | cost}}}
    written = tables.with_tables("<!-- table methods-drive -->\n<!-- end -->\n", {"drive-yoon": one})
    assert "| X | 90.0 | 100.0 | 90.0 |" in written
    assert "Not run for this state: `drive-octomap`, " in written


def test_worlds_in_which_nothing_moves_count_false_points():
    still = {"title": "X", "iou": None, "false_dynamic": 30, "true_dynamic": 0, "false_static": 0}
    moving = still | {"iou": 0.5, "true_dynamic": 10}
    one = {"country": {"n_scans": 10, "methods": {"x": still}}, "city": {"n_scans": 10, "methods": {"x": moving}}}
    other = {"country": {"n_scans": 10, "methods": {}}, "city": {"n_scans": 10, "methods": {"y": moving}}}
    assert rows.methods_of_worlds(one, other) == [
        ["method", "`country`", "`city`"],
        ["X", "(3)", "50.0"],
        ["X", "", "50.0"],
    ]


def test_a_result_of_other_code_is_out_of_date(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "RESULTS", tmp_path)
    job = jobs.JOBS["presets"]
    assert tables.state_of(job, "now") == "never run"
    (tmp_path / "presets.json").write_text('{"code": "now", "commit": "abc", "date": "2026-01-01", "is_quick": false}')
    assert tables.state_of(job, "now") == "up to date"
    assert "abc" in tables.state_of(job, "later")


def test_timed_jobs_run_first_and_alone_and_a_failure_stops_no_other_job(monkeypatch):
    run_all = importlib.import_module("all")
    both_run, order = threading.Barrier(2, timeout=30), []

    def run(job, arguments):
        order.append(job.name)
        if not job.is_timed:
            both_run.wait()  # breaks, unless they run side by side
        if job.name in ("speed", "gate"):
            raise subprocess.CalledProcessError(3, job.script)

    monkeypatch.setattr(run_all, "run", run)
    asked = [jobs.JOBS[name] for name in ("gate", "speed", "trust", "presets")]
    assert run_all.run_each(asked, argparse.Namespace(at_once=2)) == ["speed", "gate"]
    assert order[:2] == ["speed", "presets"]
    assert set(order[2:]) == {"gate", "trust"}


def gate_row(moving: int, false: int) -> dict:
    scored = {"iou": 0.5 if moving else 0.0, "true_points": moving, "missed_points": moving, "false_points": false}
    return scored | {"cpu_seconds": 6.0, "scans": 60, "peak_mb": 400.2, "called_moving": 7, "percent_moving": 0.01}


def test_the_gate_has_a_row_a_world_and_means_over_worlds_in_which_something_moves():
    found = {"100/city/VLP-16": gate_row(10, 3), "100/country/VLP-16": gate_row(0, 1200)}
    assert rows.gate({"rows": found, "calibration": {"VLP-16": [0.001, 0.0064]}}) == [
        ["world", "VLP-16"],
        ["`city`", "50.0 (3)"],
        ["`country`", "(1,200)"],
        ["**mean**", "**50.0**"],
        ["processor seconds a scan", "0.10"],
        ["peak memory, MB", "400"],
        ["calibration error, moving", "0.006"],
        ["calibration error, static", "0.001"],
    ]


def test_a_recording_without_truth_has_points_that_move_and_one_that_is_not_read_says_so():
    found = {"tutorial": gate_row(10, 0), "real/yard": gate_row(0, 0), "real/odd": {"refused": "why"}}
    assert rows.gate_recordings({"rows": found})[1:] == [
        ["tutorial", "50.0", "7", "0.0100 %"],
        ["yard", "", "7", "0.0100 %"],
        ["odd", "refused", "", ""],
    ]


def test_an_ablation_has_a_row_a_choice_and_a_column_a_recording():
    cells = [("everything", "a"), ("everything", "b"), ("no rule", "a"), ("no rule", "b")]
    result = [{"choice": c, "recording": r, "iou": 0.5, "false": 1200} for c, r in cells]
    assert rows.ablation_of_recordings(result) == [
        ["", "a", "b"],
        ["everything", "50.0 (1,200)", "50.0 (1,200)"],
        ["no rule", "50.0 (1,200)", "50.0 (1,200)"],
    ]
    assert rows.ablation_by_recording(result)[0] == ["", "everything", "no rule"]
    assert rows.ablation_by_recording(result)[2] == ["b", "50.0 (1,200)", "50.0 (1,200)"]


@pytest.mark.parametrize("choice", [name for name, change in ablation.CHOICES.items() if any(":" in p for p in change)])
def test_what_an_ablation_removes_is_there_and_shapes_a_stage(choice):
    constants = {place: value for place, value in ablation.CHOICES[choice].items() if ":" in place}
    with ablation.changed(constants):
        assert all(ablation.stages_from(place)[-1] == "labels" for place in constants)


def test_drives_that_are_off_or_warned_of_are_named_and_the_others_counted():
    found = {"a": {"off": 0.001, "said": []}, "b": {"off": 0.2, "said": []}, "c": {"off": 0.002, "said": ["poses"]}}
    assert rows.trust(found)[1:] == [
        ["b", "20.0 %", "no"],
        ["c", "0.2 %", "yes"],
        ["the other 1", "0.1 % at most", "no"],
    ]


def test_online_worlds_have_a_column_for_each_sensor_and_lag():
    cells = [(100, "city", "VLP-16", 0.0), (100, "city", "VLP-16", 0.5), (100, "country", "VLP-16", 0.0)]
    result = [{"cell": list(cell), **gate_row(cell[1] == "city", 4)} for cell in cells]
    result.append({"cell": [100, "country", "VLP-16", 0.5], **gate_row(0, 0)})
    assert rows.online_suite(result) == [
        ["world", "VLP-16, 0 s", "VLP-16, 0.5 s"],
        ["`city`", "50.0", "50.0"],
        ["`country`", "(4)", "(0)"],
        ["**mean**", "**50.0**", "**50.0**"],
    ]


def test_a_table_of_which_nothing_is_stored_stays_and_says_so():
    by_hand = "<!-- table table-2 -->\n| method | IoU |\n|---|---:|\n| X | 1.0 |\n<!-- end -->\n"
    written = tables.with_tables(by_hand, {})
    command = jobs.JOBS["table-2"].command(False)
    assert f"| X | 1.0 |\n\nOf an earlier state. Not run for this state: `{command}`.\n<!-- end -->" in written
    assert tables.with_tables(written, {}) == written
    ratios = {"iou": 0.5, "precision": None, "recall": 0.0}
    found = {"commit": "abc", "date": "2026-01-01", "is_quick": False, "result": {"rows": [{"method": "Y", **ratios}]}}
    assert "| Y | 50.0 | - | 0.0 |\n\n`python" in tables.with_tables(written, {"table-2": found})


def test_a_digest_counts_what_a_job_is_of_beside_the_method(tmp_path, monkeypatch):
    monkeypatch.setattr(scores, "PACKAGE", tmp_path)
    for name in ("voxels.py", "network/model.py", "network/lmnet.onnx"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("before")
    of_labels, of_networks = scores.code_digest(), scores.code_digest((), ("network/",))
    (tmp_path / "network/lmnet.onnx").write_text("after")
    assert scores.code_digest() == of_labels
    assert scores.code_digest((), ("network/",)) != of_networks


def test_networks_and_what_learns_from_them_are_kept_in_one_folder():
    together = [jobs.JOBS[name] for name in ("table-2", "table-3", "self-training")]
    assert len({(job.rooms, job.also) for job in together}) == 1  # one CACHE
    assert all("CACHE/networks" in job.arguments and "CACHE/networks-quick" in job.quick for job in together)
