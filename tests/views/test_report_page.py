"""The report: one page, true figures, readable without a network."""

import html
import json
import re
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner
from worlds import Block, drive, record, write_bins

from automos.cli import app
from automos.labeling import label_recording
from automos.readers import open_sequence
from automos.results.open_run import open_run
from automos.settings import load_settings
from automos.views.report import script_json, write_report
from automos.views.survey import survey


@pytest.fixture(scope="module")
def page(lane_run, tmp_path_factory):
    """Return the path of a report."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(open_run(lane_run), path)
    return path


def data_of(page):
    text = page.read_text()
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)[1])


def test_points_are_counted_as_in_the_label_files(lane_run, page):
    labels = [np.fromfile(path, np.uint32) for path in sorted((lane_run / "predictions").iterdir())]
    counted = [[int((label == value).sum()) for label in labels] for value in (0, 9, 251)]
    assert data_of(page)["points"] == counted
    assert sum(counted[2]) > 100


@pytest.mark.parametrize("name", ["{{data}}", "{{title}}", "</title><script>", "<!-- inline look.css -->"])
def test_a_name_fills_nothing_but_the_title(lane_run, tmp_path, name):
    folder = shutil.copytree(lane_run, tmp_path / "run")
    run = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps({**run, "recording": {**run["recording"], "name": name}}))
    write_report(open_run(folder), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    assert re.search("<title>(.*) – AutoMOS report</title>", text)[1] == html.escape(name)
    assert data_of(tmp_path / "report.html")["name"] == name


def test_scores_are_those_of_evaluate(lane_run, page):
    run = CliRunner().invoke(
        app, ["evaluate", str(lane_run), str(lane_run.parent / "lane"), "--json", str(page.parent / "e.json")]
    )
    assert run.exit_code == 0, run.output
    told, truth = json.loads((page.parent / "e.json").read_text()), data_of(page)["truth"]
    assert truth["all"]["iou"] == pytest.approx(told["iou"], abs=1e-5)
    assert truth["all"]["td"] == told["true_dynamic"] == sum(td for td, _, _ in truth["scans"])


def test_tracks_come_least_certain_first_and_each_has_its_picture(lane_run, page):
    told = json.loads((lane_run / "tracks.json").read_text())["tracks"]
    data = data_of(page)
    confidence = [track["confidence"] for track in data["tracks"]]
    assert confidence == sorted(confidence)
    assert sorted(track["id"] for track in data["tracks"]) == [track["id"] for track in told]
    assert set(data["pictures"]) == {str(track["id"]) for track in told}


def test_the_page_asks_nothing_of_the_network(page):
    text = page.read_text()
    addresses = set(re.findall(r"https?://[^\s\"'`)]+", text))
    assert addresses <= {"http://www.w3.org/2000/svg"}
    assert re.findall(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=\"(?!data:)", text) == []


def test_points_without_truth_are_left_out_and_counted(lane_run, tmp_path):
    recording = shutil.copytree(lane_run.parent / "lane", tmp_path / "lane")
    all_told = survey(open_run(lane_run, recording))["truth"]
    first = sorted((recording / "labels").iterdir())[0]
    truth = np.fromfile(first, np.uint32)
    n_told, truth[:100] = int((truth[:100] > 0).sum()), 0
    truth.tofile(first)
    assert n_told > 50
    assert survey(open_run(lane_run, recording))["truth"]["untold"] == all_told["untold"] + n_told


def test_a_run_without_truth_has_no_scores(lane_run, tmp_path):
    shutil.copytree(lane_run.parent / "lane", tmp_path / "lane", ignore=shutil.ignore_patterns("labels"))
    assert survey(open_run(lane_run, tmp_path / "lane"))["truth"] is None


def test_texts_of_a_recording_cannot_end_the_script_they_stand_in():
    assert "</script>" not in script_json({"name": "</script><script>alert(1)</script>"})
    assert json.loads(script_json(["</script>", "\u2028"])) == ["</script>", "\u2028"]


def test_the_command_writes_the_page_into_the_run(lane_run, tmp_path):
    shutil.copytree(lane_run, tmp_path / "run")
    run = CliRunner().invoke(app, ["report", str(tmp_path / "run")])
    assert run.exit_code == 0, run.output
    assert data_of(tmp_path / "run" / "report.html")["name"] == "lane"


def test_a_recording_that_moved_away_is_asked_for(lane_run, tmp_path):
    shutil.copytree(lane_run, tmp_path / "run")
    about = json.loads((tmp_path / "run" / "run.json").read_text())
    about["recording"]["source"] = str(tmp_path / "gone")
    (tmp_path / "run" / "run.json").write_text(json.dumps(about))
    with pytest.raises(
        ValueError, match=r"cannot be opened where it was \(.*gone does not exist.*: give its path, too"
    ):
        open_run(tmp_path / "run")
    assert len(open_run(tmp_path / "run", lane_run.parent / "lane")) == 12


@pytest.mark.browser
def test_a_browser_draws_map_curves_and_pictures(browser, page):
    browser.get(page.as_uri())
    browser.execute_async_script("setTimeout(arguments[0], 300)")
    painted = """
        const canvas = document.querySelector(arguments[0]);
        const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
        const seen = new Set();
        for (let i = 0; i < pixels.length; i += 4) if (pixels[i + 3]) seen.add(pixels.slice(i, i + 3).join());
        return seen.size;"""
    assert browser.execute_script(painted, "#map") > 10
    assert browser.execute_script(painted, "#tracks-body canvas") > 3
    assert browser.execute_script("return document.querySelectorAll('#charts svg path').length") == 8  # four, filled
    assert "IoU" in browser.find_element("id", "cards").text


@pytest.mark.browser
def test_the_cursor_of_a_curve_moves_the_map(browser, page):
    browser.get(page.as_uri())
    name = "return document.getElementById('scan-name').textContent"
    before = browser.execute_script(name)
    browser.find_element("tag name", "body").send_keys("\ue014")  # arrow right
    assert before.startswith("000006")
    assert browser.execute_script(name).startswith("000007")


@pytest.mark.browser
def test_nothing_runs_out_of_a_phones_screen(browser, page):
    size = {"width": 390, "height": 800, "deviceScaleFactor": 1, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        browser.get(page.as_uri())
        assert browser.execute_script("return document.documentElement.scrollWidth") <= 390
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


@pytest.mark.browser
@pytest.mark.parametrize("n_scans", [1, 6])
def test_a_recording_in_which_nothing_moves_has_a_page_too(tmp_path, browser, n_scans):
    walls = (Block((0.0, 12.0, 3.0), (60.0, 2.0, 6.0)), Block((0.0, -12.0, 3.0), (60.0, 2.0, 6.0)))
    write_bins(record(walls, drive(n_scans), n_beams=16).sequence, tmp_path / "still")
    label_recording(open_sequence(tmp_path / "still"), tmp_path / "run", load_settings("default"), workers=1)
    write_report(open_run(tmp_path / "run"), tmp_path / "report.html")
    assert "Nothing was found to move" in " ".join(data_of(tmp_path / "report.html")["caveats"])
    browser.get((tmp_path / "report.html").as_uri())
    assert "Nothing moves in its" in browser.find_element("id", "lead").text


def test_merged_results_without_stages_have_a_page_too(lane_run, tmp_path):
    shutil.copytree(lane_run, tmp_path / "run", ignore=shutil.ignore_patterns("stages"))
    write_report(open_run(tmp_path / "run"), tmp_path / "report.html")
    assert data_of(tmp_path / "report.html")["scans"] == 12
