"""The page of the review: for this machine's own browser alone, and what it decides is written."""

import json
import threading
import time

import numpy as np
import pytest
from asking import ask
from browsing import open_list, wait_for

from automos.core.labels import Label
from automos.review import record as record_module
from automos.review import writer as writer_module
from automos.review.decisions import read_decisions

DECIDE = {"track": 1, "verdict": "static"}


def test_it_listens_on_this_machine_alone(server):
    assert server.server_address[0] == "127.0.0.1"


def test_tracks_come_with_what_was_found_most_doubtful_points_first(server):
    status, text = ask(server, "/api/overview")
    items = json.loads(text)["items"]
    assert status == 200
    doubtful = [item["doubtful"] for item in items]
    assert doubtful == sorted(doubtful, reverse=True)
    assert len([item for item in items if "id" in item]) == len(server.session.stages.tracks)


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},  # a stranger's name that resolves to 127.0.0.1
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec_Fetch_Site": "cross-site"},
    ],
)
def test_other_sites_can_neither_read_nor_decide(server, headers):
    for path, body in (("/api/overview", None), ("/api/decide", DECIDE), ("/", None)):
        status, text = ask(server, path, body, **headers)
        assert status == 403
        assert "only the page itself" in text
    assert read_decisions(server.session.run.folder) == []


def test_a_form_of_another_site_cannot_decide_even_without_an_origin(server):
    status, _ = ask(server, "/api/decide", DECIDE, Content_Type="text/plain")
    assert status == 415
    assert read_decisions(server.session.run.folder) == []


@pytest.mark.parametrize(
    ("body", "why"),
    [
        ({"track": 9999, "verdict": "moving"}, "there is no object 9999"),
        ({"track": 1, "verdict": "parked"}, "'parked' is not a verdict"),
        ({"track": None, "verdict": "moving"}, "None is not the number of an object"),
        ({"track": 1.5, "verdict": "moving"}, "1.5 is not the number of an object"),
        ({"track": True, "verdict": "moving"}, "True is not the number of an object"),
    ],
)
def test_a_decision_that_makes_no_sense_is_refused_in_a_sentence(server, body, why):
    status, text = ask(server, "/api/decide", body)
    assert status == 400
    assert why in json.loads(text)["error"]
    assert read_decisions(server.session.run.folder) == []


@pytest.mark.parametrize("x", [1e308, -1e30])
def test_a_click_beyond_the_earth_is_refused_in_a_sentence(server, x):
    status, text = ask(server, "/api/propose", {"index": 1, "x": x, "y": 0.0})
    assert status == 400
    assert "is not a number of metres" in json.loads(text)["error"]


@pytest.mark.parametrize("path", ["/../run.json", "/page/review.html", "/api/nothing", "/%2e%2e/run.json"])
def test_no_other_file_is_served(server, path):
    assert ask(server, path)[0] == 404


def test_a_scene_holds_the_tracks_points_at_moments_of_its_life(server):
    from base64 import b64decode

    moving = next(t for t in json.loads(ask(server, "/api/overview")[1])["items"] if t["verdict"] == "moving")
    scene = json.loads(ask(server, f"/api/scene?track={moving['id']}")[1])
    points = np.frombuffer(b64decode(scene["points"]), "<i2").reshape(-1, 3) / 100.0
    kinds = np.frombuffer(b64decode(scene["kinds"]), np.uint8)
    assert len(points) == len(kinds) == scene["starts"][-1]
    assert len(scene["moments"]) == len(scene["starts"]) - 1
    for k, moment in enumerate(scene["moments"]):
        own = points[scene["starts"][k] : scene["starts"][k + 1]][
            kinds[scene["starts"][k] : scene["starts"][k + 1]] == 3
        ]
        assert len(own)
        assert np.abs(np.median(own, axis=0) - moment["box"][:3]).max() < 2.0


def test_a_decision_is_in_the_log_at_once_and_soon_in_labels_tracks_and_report(server):
    run = server.session.run.folder
    moving = next(t for t in json.loads(ask(server, "/api/overview")[1])["items"] if t["verdict"] == "moving")
    before = count_moving(run)
    status, _ = ask(server, "/api/decide", {"track": moving["id"], "verdict": "static"})
    assert status == 200
    assert [(d.track, d.verdict, d.found) for d in read_decisions(run)] == [(moving["id"], "static", "moving")]
    assert ask(server, "/api/finish", {})[0] == 200
    assert count_moving(run) < before
    track = json.loads((run / "tracks.json").read_text())["tracks"][moving["id"] - 1]
    assert (track["verdict"], track["found"]["verdict"]) == ("static", "moving")
    assert '"reviewed":true' in (run / "report.html").read_text()


def test_finishing_waits_for_a_decision_that_has_come_but_is_not_logged_yet(server, monkeypatch):
    is_deciding, real = threading.Event(), record_module.cover_tracks

    def slow(*args):
        is_deciding.set()
        time.sleep(0.5)
        return real(*args)

    monkeypatch.setattr(record_module, "cover_tracks", slow)
    run = server.session.run.folder
    moving = next(t for t in server.session.overview()["items"] if t["verdict"] == "moving")
    before = count_moving(run)
    deciding = threading.Thread(target=ask, args=(server, "/api/decide", {"track": moving["id"], "verdict": "static"}))
    deciding.start()
    assert is_deciding.wait(10)
    status, text = ask(server, "/api/finish", {})
    assert (status, json.loads(text)["decided"]) == (200, 1)
    assert [d.track for d in read_decisions(run)] == [moving["id"]]
    assert count_moving(run) < before
    assert '"reviewed":true' in (run / "report.html").read_text()
    deciding.join()


def test_decisions_are_logged_in_the_order_in_which_they_came(server, monkeypatch):
    is_deciding, real = threading.Event(), record_module.cover_tracks

    def slow_at_first(*args):
        if not is_deciding.is_set():
            is_deciding.set()
            time.sleep(0.3)
        return real(*args)

    monkeypatch.setattr(record_module, "cover_tracks", slow_at_first)
    first = threading.Thread(target=ask, args=(server, "/api/decide", {"track": 1, "verdict": "moving"}))
    first.start()
    assert is_deciding.wait(10)
    assert ask(server, "/api/decide", {"track": 1, "verdict": "unknown"})[0] == 200
    first.join()
    assert [d.verdict for d in read_decisions(server.session.run.folder)] == ["moving", "unknown"]
    assert server.session.changes.decided == {0: "unknown"}


def test_many_decisions_on_one_object_are_all_done_with_in_the_end(server):
    for verdict in ("moving", "static", "unknown") * 4:  # while the first is written, others wait
        assert ask(server, "/api/decide", {"track": 1, "verdict": verdict})[0] == 200
    status, text = ask(server, "/api/finish", {})
    assert status == 200
    said = json.loads(text)
    assert set(said.pop("iou")) == {"found", "now"}
    assert said == {"waiting": 0, "problem": None, "decided": 1, "finishing": False}
    assert len(read_decisions(server.session.run.folder)) == 12


def test_a_review_goes_on_after_finishing_until_it_is_closed(server):
    run = server.session.run.folder
    for verdict in ("unknown", "static"):
        assert ask(server, "/api/decide", {"track": 1, "verdict": verdict})[0] == 200
        assert ask(server, "/api/finish", {})[0] == 200
        assert json.loads((run / "tracks.json").read_text())["tracks"][0]["verdict"] == verdict


def test_a_decision_after_the_end_of_the_review_is_refused_in_a_sentence(server):
    server.session.close()
    status, text = ask(server, "/api/decide", {"track": 1, "verdict": "unknown"})
    assert status == 400
    assert json.loads(text)["error"] == (
        "this review has ended, and object 1 was not decided on; run automos review again and decide there"
    )
    assert read_decisions(server.session.run.folder) == []


def test_a_decision_is_refused_at_once_while_the_last_ones_are_written(server, monkeypatch):
    is_writing, may_end, real = threading.Event(), threading.Event(), writer_module.write_report

    def slow(*args):
        is_writing.set()
        assert may_end.wait(20)
        real(*args)

    monkeypatch.setattr(writer_module, "write_report", slow)
    assert ask(server, "/api/decide", {"track": 1, "verdict": "unknown"})[0] == 200
    closing = threading.Thread(target=server.session.close)
    closing.start()
    assert is_writing.wait(10)
    status, text = ask(server, "/api/decide", {"track": 2, "verdict": "unknown"})
    may_end.set()
    closing.join()
    assert (status, "this review has ended" in text) == (400, True)
    assert [d.track for d in read_decisions(server.session.run.folder)] == [1]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), ValueError("something else")])
def test_what_could_not_be_written_is_told_and_tried_again(server, monkeypatch, error):
    run, real = server.session.run.folder, writer_module.rewrite_scan
    moving = next(t for t in server.session.overview()["items"] if t["verdict"] == "moving")
    before = count_moving(run)

    def fail(*_):
        raise error

    monkeypatch.setattr(writer_module, "rewrite_scan", fail)
    assert ask(server, "/api/decide", {"track": moving["id"], "verdict": "static"})[0] == 200
    status, text = ask(server, "/api/finish", {})
    assert status == 400
    assert str(error.args[-1]) in json.loads(text)["error"]
    assert count_moving(run) == before
    monkeypatch.setattr(writer_module, "rewrite_scan", real)
    status, text = ask(server, "/api/finish", {})
    assert (status, json.loads(text)["problem"]) == (200, None)
    assert count_moving(run) < before


def count_moving(run):
    return sum(int((np.fromfile(p, np.uint32) & 0xFFFF == Label.MOVING).sum()) for p in (run / "predictions").iterdir())


# ------------------------------------------------------------------------------------------------------ in a browser
@pytest.mark.browser
def test_one_key_decides_and_shows_the_next(browser, server):
    first = open_list(browser, server)
    browser.find_element("tag name", "body").send_keys("u")
    wait_for(browser, f"document.body.dataset.shown !== '{first}'")
    wait_for(browser, "document.getElementById('saved').textContent === 'saved ✓'")
    assert [(d.track, d.verdict) for d in read_decisions(server.session.run.folder)] == [(int(first), "unknown")]
    items = server.session.overview()["items"]
    assert len(items) == len(server.session.stages.tracks)
    n = sum(bool(item["core"] or item["decided"]) for item in items)  # what is decided is counted, and stays in sight
    assert f"worth a look {n}\nall {len(items)}" in browser.find_element("id", "filters").text
    assert not browser.find_element("id", "progress-text").text.startswith("0 %")

    browser.find_element("tag name", "body").send_keys("\ue013")  # arrow up
    wait_for(browser, f"document.body.dataset.shown === '{first}'")
    browser.find_element("tag name", "body").send_keys("z")
    wait_for(browser, "document.getElementById('saved').textContent === 'saved ✓'")
    assert server.session.changes.decided == {}


@pytest.mark.browser
def test_an_object_is_drawn_in_3d_and_from_above(browser, server):
    open_list(browser, server)
    moving = next(t for t in server.session.overview()["items"] if t["verdict"] == "moving")["id"]
    browser.execute_script(f"document.querySelector('#queue [data-id=\"{moving}\"]').click()")
    wait_for(browser, f"document.body.dataset.shown === '{moving}'")
    browser.execute_async_script("setTimeout(arguments[0], 300)")
    greens = """(() => {
        const canvas = document.getElementById("%s");
        const copy = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
        const context = copy.getContext("2d");
        context.drawImage(canvas, 0, 0);
        const p = context.getImageData(0, 0, copy.width, copy.height).data;
        let n = 0;
        for (let i = 0; i < p.length; i += 4) n += p[i + 3] > 0 && p[i + 1] > 1.4 * p[i] && p[i + 1] > 1.2 * p[i + 2];
        return n;
    })()"""
    assert wait_for(browser, greens % "above") > 20
    assert wait_for(browser, greens % "space") > 20


@pytest.mark.browser
def test_finishing_writes_the_report_and_says_so(browser, server):
    browser.get(server.url)
    wait_for(browser, "document.body.dataset.shown")
    browser.find_element("tag name", "body").send_keys("m")
    browser.find_element("id", "finish").click()
    wait_for(browser, "document.getElementById('over-title').textContent === 'All saved'", 30)
    assert (server.session.run.folder / "report.html").exists()


def hinder_decisions(browser, body):
    """Have `body`, JavaScript, run before each decision is sent; `count` numbers them from 1."""
    browser.execute_script(f"""
        const send = window.fetch.bind(window);
        let count = 0;
        window.fetch = async (path, options) => {{
            if (path === "api/decide") {{ count += 1; {body} }}
            return send(path, options);
        }};
    """)


@pytest.mark.browser
def test_finishing_waits_for_decisions_on_their_way(browser, server):
    browser.get(server.url)
    first = wait_for(browser, "document.body.dataset.shown")
    hinder_decisions(browser, "await new Promise((done) => setTimeout(done, 700));")
    browser.find_element("tag name", "body").send_keys("u")
    browser.find_element("id", "finish").click()
    wait_for(browser, "document.getElementById('over-title').textContent === 'All saved'", 30)
    run = server.session.run.folder
    assert [(d.track, d.verdict) for d in read_decisions(run)] == [(int(first), "unknown")]
    assert json.loads((run / "tracks.json").read_text())["tracks"][int(first) - 1]["verdict"] == "unknown"
    assert '"reviewed":true' in (run / "report.html").read_text()


@pytest.mark.browser
def test_the_report_says_what_a_person_decided_in_the_words_of_the_review(browser, server):
    server.session.decide([1], "unknown")
    server.session.finish()
    browser.get((server.session.run.folder / "report.html").as_uri())
    assert wait_for(browser, "document.querySelector('#tracks-body .tag.unknown')").text == "unsure"
    shown = browser.find_element("tag name", "body").text
    assert "✓ reviewed" in shown
    assert "1 verdict was decided by a person" in shown
    assert "unsure 1" in shown
    assert "unknown" not in shown.replace("compensated already, or unknown", "")  # of times, not of verdicts


@pytest.mark.browser
def test_quick_decisions_on_one_object_are_logged_in_their_order(browser, server):
    first = open_list(browser, server)
    hinder_decisions(browser, "if (count === 1) await new Promise((done) => setTimeout(done, 2500));")
    body = browser.find_element("tag name", "body")
    body.send_keys("u")
    wait_for(browser, f"document.body.dataset.shown !== '{first}'")
    body.send_keys("\ue013")  # arrow up
    wait_for(browser, f"document.body.dataset.shown === '{first}'")
    body.send_keys("s")
    wait_for(browser, "document.getElementById('saved').textContent === 'saved ✓'")
    assert [d.verdict for d in read_decisions(server.session.run.folder)] == ["unknown", "static"]
    assert server.session.changes.decided == {int(first) - 1: "static"}


@pytest.mark.browser
def test_a_decision_that_cannot_be_saved_is_told_and_sent_again(browser, server):
    first = open_list(browser, server)
    browser.execute_script("window.send = window.fetch.bind(window)")
    hinder_decisions(browser, "throw new TypeError('Failed to fetch');")
    body = browser.find_element("tag name", "body")
    body.send_keys("u")
    wait_for(browser, "document.querySelector('#saved.problem')")
    wait_for(browser, f"document.body.dataset.shown !== '{first}'")
    body.send_keys("u")
    wait_for(browser, "document.querySelector('#saved.problem')?.textContent.startsWith('2 decisions are not saved')")
    browser.execute_script("window.fetch = () => Promise.reject(new TypeError('Failed to fetch'))")
    browser.execute_script("[...document.querySelectorAll('#queue button')].at(-1).click()")  # cannot be drawn
    browser.execute_async_script("setTimeout(arguments[0], 300)")
    assert browser.find_element("id", "saved").text.startswith("2 decisions are not saved")
    browser.find_element("id", "finish").click()
    wait_for(browser, "document.getElementById('over-title').textContent === 'Not all could be saved'")
    assert f"{first}, " in browser.find_element("id", "over-text").text
    assert read_decisions(server.session.run.folder) == []

    browser.execute_script("window.fetch = send")
    browser.find_element("id", "over-back").click()
    browser.find_element("id", "finish").click()
    wait_for(browser, "document.getElementById('over-title').textContent === 'All saved'", 30)
    assert [d.verdict for d in read_decisions(server.session.run.folder)] == ["unknown", "unknown"]
    assert browser.find_element("id", "over-text").text.startswith("2 objects were decided")


@pytest.mark.browser
def test_an_object_that_is_not_drawn_yet_is_not_decided_on(browser, server):
    first = open_list(browser, server)
    browser.execute_script("""
        const send = window.fetch.bind(window);
        window.fetch = (path, options) => path.startsWith("api/scene") ? new Promise(() => {}) : send(path, options);
    """)
    body = browser.find_element("tag name", "body")
    browser.execute_script("[...document.querySelectorAll('#queue [data-id]')].at(-1).click()")  # not fetched ahead
    body.send_keys("u")
    browser.execute_script("document.getElementById('queue').scrollTop = 0")  # rows out of sight are not drawn
    wait_for(browser, f"document.querySelector('#queue [data-id=\"{first}\"]')")
    browser.execute_script(f"document.querySelector('#queue [data-id=\"{first}\"]').click()")
    body.send_keys("s")
    wait_for(browser, "document.getElementById('saved').textContent === 'saved ✓'")
    assert [(d.track, d.verdict) for d in read_decisions(server.session.run.folder)] == [(int(first), "static")]


@pytest.mark.browser
def test_a_key_held_down_decides_once(browser, server):
    browser.get(server.url)
    first = wait_for(browser, "document.body.dataset.shown")
    for is_repeat in ("false", "true", "true"):
        event = f"new KeyboardEvent('keydown', {{ key: 'u', bubbles: true, repeat: {is_repeat} }})"
        browser.execute_script(f"document.body.dispatchEvent({event})")
    wait_for(browser, "document.getElementById('saved').textContent === 'saved ✓'")
    assert [d.track for d in read_decisions(server.session.run.folder)] == [int(first)]


@pytest.mark.browser
def test_what_is_told_over_the_page_is_closed_by_a_key_and_keys_decide_again(browser, server):
    browser.get(server.url)
    first = wait_for(browser, "document.body.dataset.shown")
    browser.find_element("id", "finish").click()
    wait_for(browser, "document.getElementById('over-title').textContent === 'All saved'", 30)
    browser.switch_to.active_element.send_keys("u")  # decides nothing below the dialog
    browser.switch_to.active_element.send_keys("\ue00c")  # escape
    wait_for(browser, "!document.getElementById('over').open")
    browser.find_element("tag name", "body").send_keys("s")
    wait_for(browser, "document.getElementById('saved').textContent === 'saved ✓'")
    assert [(d.track, d.verdict) for d in read_decisions(server.session.run.folder)] == [(int(first), "static")]


@pytest.mark.browser
def test_letters_decide_while_a_button_has_the_focus_and_space_is_the_buttons(browser, server):
    first = open_list(browser, server)
    browser.execute_script("document.getElementById('add').focus()")
    browser.switch_to.active_element.send_keys("u")
    wait_for(browser, f"document.body.dataset.shown !== '{first}'")
    browser.execute_script("document.getElementById('add').focus()")
    browser.switch_to.active_element.send_keys(" ")
    wait_for(browser, "document.body.dataset.mode === 'place'")
