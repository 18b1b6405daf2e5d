"""The file by which a browser finds the page: for one user, for the time of the review."""

import os

import pytest
from asking import ask
from browsing import wait_for
from typer.testing import CliRunner

from automos.cli import app
from automos.review.private_page import private_page
from automos.review.server import ReviewServer


def test_only_its_owner_may_read_the_address_which_is_gone_afterwards(tmp_path):
    (tmp_path / "open_review.html").write_text("of a review that was killed, for all to read")
    with private_page(tmp_path, "http://127.0.0.1:1/?token=abc") as page:
        assert "http://127.0.0.1:1/?token=abc" in page.read_text()
        assert os.name == "nt" or page.stat().st_mode & 0o777 == 0o600
    assert not page.exists()


def test_the_token_is_not_among_the_arguments_of_the_browser(lane_run, monkeypatch):
    launched = []
    monkeypatch.setattr("typer.launch", lambda target: launched.append(target) or 0)
    monkeypatch.setattr(ReviewServer, "serve_forever", lambda server: None)
    done = CliRunner().invoke(app, ["review", str(lane_run)])
    assert done.exit_code == 0, done.output
    assert launched == [str(lane_run / "open_review.html")]
    assert "token=" in done.output
    assert not (lane_run / "open_review.html").exists()


def test_another_site_opens_the_page_only_by_its_whole_address(server):
    from_afar = {"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Mode": "navigate"}
    assert ask(server, f"/?token={server.token}", **from_afar, Cookie=None)[0] == 200
    for path, body in (("/", None), ("/?token=x", None), (f"/api/status?token={server.token}", None), ("/?token=", {})):
        assert ask(server, path, body, **from_afar)[0] == 403
    assert ask(server, f"/?token={server.token}", Sec_Fetch_Site="cross-site", Sec_Fetch_Mode="no-cors")[0] == 403


@pytest.mark.browser
def test_a_browser_gets_to_the_page_by_the_file(browser, server, tmp_path):
    with private_page(tmp_path, server.url) as page:
        browser.get(page.as_uri())
        assert wait_for(browser, "document.body.dataset.shown", seconds=30)
    browser.refresh()
    assert wait_for(browser, "document.body.dataset.shown", seconds=30)
