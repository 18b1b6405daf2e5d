"""The pages of the review as a person uses them, in a browser."""

import json
import shutil
import threading
from functools import partial

import numpy as np
import pytest
from browsing import open_list, until
from browsing import wait_for as browser_waits

from automos.objects.verdict import Verdict
from automos.results.open_run import open_run
from automos.review import writer as writer_module
from automos.review.amendments import read_amendments
from automos.review.proposals import Proposer
from automos.review.server import ReviewServer
from automos.review.session import Session

pytestmark = pytest.mark.browser
wait_for = partial(browser_waits, seconds=30)
ENTER, ESCAPE = "\ue007", "\ue00c"


def press(browser, key):
    browser.find_element("tag name", "body").send_keys(key)


def test_a_filter_keeps_what_is_open_in_sight(browser, server):
    server.session.decide([2], "static")
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
    open_list(browser, server)
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


def test_what_was_decided_last_is_taken_back_by_a_key_and_the_object_is_open_again(browser, server):
    from selenium.webdriver.common.keys import Keys

    first = open_list(browser, server)
    found = server.session.overview()["items"][0]["verdict"]
    assert browser.execute_script("return document.getElementById('undo').disabled")
    press(browser, "s" if found == "moving" else "m")
    wait_for(browser, f"document.body.dataset.shown !== '{first}' && document.body.dataset.shown")
    wait_for(browser, "document.getElementById('saved').textContent === 'saved ✓'")
    assert server.session.changes.decided == {first - 1: "static" if found == "moving" else "moving"}
    press(browser, Keys.BACKSPACE)
    wait_for(browser, f"document.body.dataset.shown === '{first}'")
    wait_for(browser, "document.getElementById('undo').disabled")
    assert server.session.changes.decided == {}


def test_what_is_worth_knowing_is_beside_the_list_and_keys_decide_at_once(browser, server):
    run = json.loads((server.session.run.folder / "run.json").read_text())
    run["warnings"] = [{"sentence": "No scan has a time."}]
    (server.session.run.folder / "run.json").write_text(json.dumps(run))
    first = open_list(browser, server)
    assert wait_for(browser, "document.getElementById('knowing').innerText").endswith("No scan has a time.")
    other = "static" if server.session.overview()["items"][0]["verdict"] == "moving" else "moving"
    press(browser, other[0])
    wait_for(browser, f"document.body.dataset.shown !== '{first}'")
    wait_for(browser, "document.getElementById('saved').textContent === 'saved ✓'")
    assert server.session.changes.decided == {first - 1: other}


def test_the_list_holds_what_is_worth_a_look_and_all_keys_are_listed(browser, server):
    browser.get(server.url)
    wait_for(browser, "document.body.dataset.shown")
    chip = (
        "[...document.querySelectorAll('#filters button')].find((one) => one.getAttribute('aria-pressed') === 'true')"
    )
    items = server.session.overview()["items"]
    n = sum(item.get("core", False) or "place" in item for item in items)
    assert browser.execute_script(f"return {chip}.textContent") == f"worth a look {n}"
    press(browser, "?")
    assert "take back what was done last" in wait_for(browser, "document.getElementById('over-text').textContent")
    assert not browser.execute_script("return document.getElementById('loading').textContent")


def test_the_chosen_object_is_outlined_in_the_scan_and_a_click_on_a_moving_one_opens_it(browser, server):
    from selenium.webdriver import ActionChains

    moving = next(t for t in server.session.overview()["items"] if t["verdict"] == "moving")["id"]
    browser.get(server.url)
    wait_for(browser, "document.body.dataset.shown")
    press(browser, "n")
    wait_for(browser, "document.body.dataset.place")
    scan = int(wait_for(browser, "document.body.dataset.place"))
    boxes = {one: box for one, *box in server.session.place(scan)["boxes"]}
    if moving not in boxes:
        tracks = server.session.stages.tracks
        scan = int(tracks.scan[tracks.track == moving - 1][0])
        browser.execute_script(
            f"const at = document.getElementById('moment'); at.value = {scan}; at.dispatchEvent(new Event('input'))"
        )
        wait_for(browser, f"document.body.dataset.place === '{scan}'")
        boxes = {one: box for one, *box in server.session.place(scan)["boxes"]}
    view = json.loads(wait_for(browser, "document.getElementById('place').dataset.view"))
    canvas = browser.find_element("id", "place")
    x, y = (boxes[moving][0] - view["x"]) * view["zoom"], (view["y"] - boxes[moving][1]) * view["zoom"]
    ActionChains(browser).move_to_element_with_offset(canvas, round(x), round(y)).click().perform()
    wait_for(browser, f"document.body.dataset.shown === '{moving}'")
    assert wait_for(browser, "document.querySelector('.row[aria-current=true]').dataset.id") == str(moving)


def missed(session):
    """Judge a moving track static, as if it had been missed; return a scan and where one of its points is there."""
    track = int(np.flatnonzero(session.stages.verdicts.verdict == Verdict.MOVING)[0])
    session.decide([track + 1], "static")
    tracks = session.stages.tracks
    seen = np.flatnonzero(tracks.is_observed & (tracks.track == track))
    row = seen[len(seen) // 2]
    frame = session.stages.frame(tracks.scan[row])
    own = frame.points_level[session.stages.labels(tracks.scan[row])["track"][frame.kept] == track]
    return int(tracks.scan[row]), own[np.linalg.norm(own - np.median(own, axis=0), axis=1).argmin()]


def test_what_was_missed_is_added_by_a_click_and_taken_back_by_a_key(browser, server):
    from selenium.webdriver import ActionChains

    scan, point = missed(server.session)
    browser.get(server.url)
    wait_for(browser, "document.body.dataset.shown")
    press(browser, "n")
    wait_for(browser, "document.body.dataset.place")
    slide = f"at.value = {scan}; at.dispatchEvent(new Event('input'))"
    browser.execute_script(f"const at = document.getElementById('moment'); {slide}")
    wait_for(browser, f"document.body.dataset.place === '{scan}'")
    view = json.loads(wait_for(browser, "document.getElementById('place').dataset.view"))
    off = ((point[0] - view["x"]) * view["zoom"], (view["y"] - point[1]) * view["zoom"])
    canvas = browser.find_element("id", "place")
    ActionChains(browser).move_to_element_with_offset(canvas, *map(round, off)).click().perform()
    wait_for(browser, "document.body.dataset.mode === 'proposal'")
    wait_for(browser, "!document.body.classList.contains('busy')")
    press(browser, "\ue007")  # enter
    wait_for(browser, "document.body.dataset.added && document.body.dataset.mode === 'place'")
    assert [one["made"] for one in server.session.overview()["items"] if "made" in one] == ["added"]
    wait_for(browser, "!document.body.classList.contains('busy')")
    browser.execute_script(  # all that is told, however soon "saved" takes its place
        "const at = document.getElementById('saved'); window.told = [];"
        "new MutationObserver(() => told.push(at.textContent)).observe(at, {childList: true})"
    )
    press(browser, "z")
    wait_for(browser, "told.some((text) => text.includes('taken back'))")
    assert [one for one in server.session.overview()["items"] if "made" in one] == []


def test_finishing_goes_on_without_the_page_and_a_page_opened_again_says_so(browser, server, monkeypatch):
    may_end, real = threading.Event(), writer_module.write_report

    def wait_and_write(*args):
        may_end.wait(120)
        real(*args)

    monkeypatch.setattr(writer_module, "write_report", wait_and_write)
    browser.get(server.url)
    wait_for(browser, "document.body.dataset.shown")
    press(browser, "m")
    browser.find_element("id", "finish").click()
    # Only what the server was asked for goes on; a page that still holds decisions asks before it is left.
    wait_for(browser, "fetch('api/status').then((answer) => answer.json()).then((status) => status.finishing)")
    page = browser.current_window_handle
    browser.switch_to.new_window("tab")
    another = browser.current_window_handle
    browser.switch_to.window(page)
    browser.close()
    browser.switch_to.window(another)
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


@pytest.fixture
def places(server):
    """Return two places of a mover that was missed, in the list of the session."""
    session = server.session
    track = int(np.flatnonzero(session.stages.verdicts.verdict == Verdict.MOVING)[0])
    session.decide([track + 1], "static")
    tracks = session.stages.tracks
    seen = np.flatnonzero(tracks.is_observed & (tracks.track == track))
    session.queue.places = [
        {
            "place": n, "sentence": "Was it lost?", "track": track + 1, "at": [0.0, 0.0], "points": 10**6 - n,
            "scan": session.stages.names[tracks.scan[row]], "segment": int(tracks.segment[row]),
        }
        for n, row in enumerate(seen[[len(seen) // 2, len(seen) // 2 + 1]])
    ]  # fmt: skip
    return session.queue.places


def test_a_place_is_shown_while_it_is_followed_and_added_whole_unless_escape_gives_it_up(
    browser, server, places, monkeypatch
):
    may_go_on, real, near = threading.Event(), Proposer._painted, server.session._near
    near._most = 3

    def slow(proposer, *args):
        if proposer is not near:
            may_go_on.wait(60)
        return real(proposer, *args)

    monkeypatch.setattr(Proposer, "_painted", slow)
    browser.get(server.url)
    wait_for(browser, "document.body.dataset.shown === 'p0'")
    facts = "document.getElementById('facts').textContent"
    wait_for(browser, f"{facts}.includes('5 scans so far')")
    told = "document.getElementById('saved').textContent"
    wait_for(browser, f"/scan 1 of [0-9]+/.test({told})")
    press(browser, ENTER)
    wait_for(browser, "document.body.classList.contains('busy')")
    press(browser, ESCAPE)
    wait_for(browser, f"{told} === 'given up'")
    may_go_on.set()
    wait_for(browser, "!document.body.classList.contains('busy')")
    assert not browser.execute_script("return document.querySelector('#saved.problem')")
    assert server.session.changes.amendments == []
    press(browser, ENTER)
    wait_for(browser, "document.body.dataset.added")
    (made,) = server.session.changes.amendments
    assert len(made.parts) > 5
    browser.get("about:blank")  # it asks for the status now and then


def test_a_place_where_all_moves_already_is_shown_from_above_and_done_with_by_escape(browser, server, places):
    server.session.decide([places[0]["track"]], "moving")
    browser.get(server.url)
    wait_for(browser, "document.querySelector('#queue [data-id=p0]')")
    browser.execute_script("document.querySelector('#queue [data-id=p0]').click()")
    wait_for(browser, "document.body.dataset.shown === 'p0'")
    assert browser.execute_script("return document.body.dataset.mode") == "place"
    wait_for(browser, "document.querySelector('#saved.problem').textContent.includes('moves already')")
    assert browser.execute_script("return document.getElementById('facts').textContent") == "Was it lost?"
    press(browser, ESCAPE)
    wait_for(browser, "document.body.dataset.shown === 'p1'")
    assert len(server.session.queue._dismissed()) == 1
    browser.get_log("browser")  # that the request was refused


def test_the_next_place_is_made_while_one_is_looked_at(browser, server, places, monkeypatch):
    browser.get(server.url)
    wait_for(browser, "document.body.dataset.shown === 'p0'")
    made = Proposer.from_segment, server.session.stages.index[places[1]["scan"]], places[1]["segment"]
    proposals = server.session.proposals
    until(lambda: made in proposals._kept and not proposals._ahead)
    monkeypatch.setattr(Proposer, "_painted", lambda *args: pytest.fail("it is followed anew"))
    press(browser, ESCAPE)  # nothing was missed at the first
    wait_for(browser, "document.body.dataset.shown === 'p1'")
    assert [row["decided"] for row in server.session.overview()["items"] if "place" in row] == ["done", None]
    browser.get("about:blank")  # it asks for the status now and then
