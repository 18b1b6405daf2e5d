"""The tables of README and docs show what is stored, and nothing else."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
import tables


def stored(iou: float) -> dict:
    method = {"title": "X", "iou": iou, "precision": 1.0, "recall": iou, "true_dynamic": 1, "false_static": 0}
    result = {"drive": {"n_scans": 2, "methods": {"paper": method, "default": method}}}
    return {"command": "python benchmarks/x.py", "commit": "abc", "date": "2026-01-01", "result": result}


@pytest.mark.parametrize("page", tables.pages(), ids=lambda page: page.name)
def test_a_page_shows_the_stored_results(page):
    text = page.read_text()
    assert set(tables.names_in(text)) <= set(tables.TABLES)
    assert text.count("<!-- table ") == text.count("<!-- end -->") == len(list(tables.names_in(text)))
    results = {name: found for name in tables.JOBS if (found := tables.read_result(name)) is not None}
    assert tables.with_tables(text, results) == text, "run python benchmarks/all.py --write"


def test_the_readme_leads_with_stored_figures():
    names = list(tables.names_in((tables.ROOT / "README.md").read_text()))
    assert "presets-drive" in names
    if not tables.RESULTS.exists():
        pytest.skip("nothing is stored yet: run python benchmarks/all.py --drive DRIVE_0005")
    assert all(tables.read_result(tables.TABLES[name][0]) is not None for name in names)


def test_every_table_has_a_job():
    assert {job for job, _ in tables.TABLES.values()} == set(tables.JOBS)


def test_a_figure_that_differs_is_seen():
    page = "Before.\n<!-- table presets-drive -->\n<!-- end -->\nAfter.\n"
    written = tables.with_tables(page, {"presets": stored(0.9)})
    assert "| `default` | 90.0 | 100.0 | 90.0 |" in written
    assert written.startswith("Before.\n")
    assert written.endswith("<!-- end -->\nAfter.\n")
    assert tables.with_tables(written, {"presets": stored(0.9)}) == written
    assert tables.with_tables(written, {"presets": stored(0.8)}) != written
    assert tables.with_tables(page, {}) == page  # nothing stored, nothing touched


def test_worlds_in_which_nothing_moves_count_false_points():
    still = {"title": "X", "iou": None, "false_dynamic": 30, "true_dynamic": 0, "false_static": 0}
    moving = still | {"iou": 0.5, "true_dynamic": 10}
    rows = tables._methods_of_worlds(
        {
            "country": {"n_scans": 10, "methods": {"x": still}},
            "city": {"n_scans": 10, "methods": {"x": moving, "y": moving}},
        }
    )
    assert rows == [["method", "`country`", "`city`"], ["X", "(3)", "50.0"], ["X", "", "50.0"]]


def test_a_result_of_other_code_is_out_of_date(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "RESULTS", tmp_path)
    job = tables.JOBS["presets"]
    assert tables.state_of(job, "now") == "never run"
    (tmp_path / "presets.json").write_text('{"code": "now", "commit": "abc", "date": "2026-01-01"}')
    assert tables.state_of(job, "now") == "up to date"
    assert "abc" in tables.state_of(job, "later")
