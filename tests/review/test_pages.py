"""The pages of the review as a person uses them, in a browser."""

import json
import shutil
import threading
import time

import pytest

from automos.results.open_run import open_run
from automos.review import writer as writer_module
from automos.review.amendments import read_amendments
from automos.review.server import ReviewServer
from automos.review.session import Session

pytestmark = pytest.mark.browser


def wait_for(browser, script, seconds=30):
    """Return what `script` returns as soon as that is something."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = browser.execute_script(f"return {script}")
        if found:
            return found
        time.sleep(0.05)
    raise AssertionError(f"never true: {script}")


def press(browser, key):
    browser.find_element("tag name", "body").send_keys(key)


def test_a_filter_keeps_what_is_open_in_sight(browser, server):
    browser.get(server.url)
    first = wait_for(browser, "document.body.dataset.shown")
    verdict = wait_for(browser, "document.querySelector('.row[aria-current=true] .tag').textContent")
    other = "moving" if verdict == "static" else "static"
    script = f"[...document.querySelectorAll('#filters button')].find((chip) => chip.textContent.startsWith('{other}'))"
    browser.execute_script(f"{script}.click()")
    wait_for(browser, f"{script}.getAttribute('aria-pressed') === 'true'")
    assert browser.execute_script("return document.querySelector('.row[aria-current=true]').dataset.id") == first
    assert browser.execute_script("return document.body.dataset.shown") == first


def test_an_object_is_cut_and_joined_again_by_keys(browser, server):
    browser.get(server.url)
    wait_for(browser, "document.body.dataset.shown")
    moving = next(t for t in server.session.overview()["items"] if t["verdict"] == "moving")["id"]
    browser.execute_script(f"document.querySelector('#queue [data-id=\"{moving}\"]').click()")
    wait_for(browser, f"document.body.dataset.shown === '{moving}'")
    press(browser, " ")  # no longer playing
    browser.execute_script(
        "const at = document.getElementById('moment'); at.value = 5; at.dispatchEvent(new Event('input'))"
    )
    press(browser, "c")
    half = int(wait_for(browser, f"document.body.dataset.shown !== '{moving}' && document.body.dataset.shown"))
    folder = server.session.run.folder
    assert [one.how for one in read_amendments(folder)] == ["cut", "cut"]
    wait_for(browser, "!document.body.classList.contains('busy')")
    press(browser, "j")
    browser.execute_script(f"document.querySelector('#queue [data-id=\"{half + 1}\"]').click()")
    wait_for(browser, f"document.body.dataset.shown === '{half + 1}'")
    press(browser, "j")
    wait_for(browser, f"document.body.dataset.shown === '{half + 2}'")
    assert [one["made"] for one in server.session.overview()["items"] if "made" in one] == ["joined"]


def test_finishing_goes_on_without_the_page_and_a_page_opened_again_says_so(browser, server, monkeypatch):
    may_end, real = threading.Event(), writer_module.write_report

    def wait_and_write(*args):
        may_end.wait(30)
        real(*args)

    monkeypatch.setattr(writer_module, "write_report", wait_and_write)
    browser.get(server.url)
    wait_for(browser, "document.body.dataset.shown")
    press(browser, "m")
    browser.find_element("id", "finish").click()
    wait_for(browser, "document.getElementById('over').open")
    browser.get("about:blank")
    browser.get(server.url)
    wait_for(browser, "document.getElementById('over-title').textContent.startsWith('Writing labels')")
    may_end.set()
    wait_for(browser, "document.getElementById('over-title').textContent === 'All saved'")
    assert '"reviewed":true' in (server.session.run.folder / "report.html").read_text()


def test_a_sample_is_answered_by_keys_and_tells_how_good_the_labels_are(browser, lane_run, tmp_path):
    run = shutil.copytree(lane_run, tmp_path / "run")
    session = Session(open_run(run), n_looks=12)
    server = ReviewServer(session)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    kinds = [look.kind for look in session.looking.sample.looks]
    try:
        browser.get(server.url)
        for number, kind in enumerate(kinds):
            wait_for(browser, f"document.body.dataset.shown === '{number}'")
            press(browser, {"moving": "m", "fringe": "s", "moment": "\ue007"}[kind])
        wait_for(browser, "document.getElementById('over-title').textContent === 'All answered'")
        told = browser.find_element("id", "over-text").text
        assert told.startswith("Precision 100.0 % (")
        assert "recall 100.0 % (" in told
        press(browser, "\ue00c")
    finally:
        server.shutdown()
        server.server_close()
        session.close()
    assert json.loads((run / "run.json").read_text())["quality"]["precision"]["value"] == 1.0
