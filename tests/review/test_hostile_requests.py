"""Whatever a program on this machine or a page of strangers sends, the review refuses it, in time, and goes on."""

import http.client
import json
import socket
import threading
import time

import pytest
from asking import ask

from automos.review import server as server_module
from automos.review.api import MAX_BODY
from automos.review.decisions import read_decisions
from automos.review.server import ReviewServer

DECIDE = {"track": 1, "verdict": "static"}


def say(server, text, patience=10.0):
    """Return what the server answers to bytes, until it hangs up."""
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=patience) as connection:
        connection.sendall(text.replace(b"HOST", b"127.0.0.1:%d" % server.server_port))
        answer = b""
        while part := connection.recv(65536):
            answer += part
    return answer


def is_well(server):
    return ask(server, "/api/status")[0] == 200


# --------------------------------------------------------------------------------------------------------- the token
@pytest.mark.parametrize(
    "cookie",
    [
        "",
        "automos=x",
        "automos{port}=",
        "automos{port}=wrong",
        "automos1={token}",
        "a" * 5000,
        "\x01=\x02",
        "=;=;=",
        '"',
    ],
)
def test_who_does_not_know_the_token_may_neither_read_nor_decide(unmoved, cookie):
    cookie = cookie.format(port=unmoved.server_port, token=unmoved.token)
    for path, body in (("/api/overview", None), ("/", None), ("/review.js", None), ("/api/decide", DECIDE)):
        status, text = ask(unmoved, path, body, Cookie=cookie)
        assert status == 403
        assert "token" in json.loads(text)["error"]
    assert read_decisions(unmoved.session.run.folder) == []
    assert is_well(unmoved)


@pytest.mark.parametrize("query", ["token=", "token=wrong", "token=%ff%fe", "token", "Token={token}", "token={token}x"])
def test_an_address_with_another_token_opens_nothing(unmoved, query):
    assert ask(unmoved, "/?" + query.format(token=unmoved.token), Cookie=None)[0] == 403


def test_the_printed_address_opens_the_page_which_keeps_the_token_from_scripts_and_other_sites(server):
    status, text = ask(server, "/?" + server.url.partition("?")[2], Cookie=None)
    assert status == 200
    assert "<title>AutoMOS review</title>" in text
    raw = say(server, f"GET /?token={server.token} HTTP/1.1\r\nHost: HOST\r\nConnection: close\r\n\r\n".encode())
    assert f"Set-Cookie: {server.cookie}; HttpOnly; SameSite=Strict; Path=/".encode() in raw
    assert b"Referrer-Policy: no-referrer" in raw


def test_the_printed_address_opens_the_page_where_an_earlier_review_left_its_cookie(server):
    stale = f"automos{server.server_port}=of-the-review-before"
    assert ask(server, f"/?token={server.token}", Cookie=stale)[0] == 200
    assert ask(server, "/?token=wrong", Cookie=stale)[0] == 403
    assert ask(server, "/", Cookie=stale)[0] == 403


def test_each_review_has_a_token_of_its_own(server):
    other = ReviewServer(server.session)
    other.server_close()
    assert len({server.token, other.token}) == 2
    assert len(server.token) >= 32


# ----------------------------------------------------------------------------------------------- size, form and speed
@pytest.mark.parametrize(
    "length", ["-1", "+5", "1e3", "٣", "", " ", "99999999999999999999", str(MAX_BODY + 1), "12, 12", "0x10"]
)
def test_what_is_too_long_or_of_no_length_is_refused_before_it_is_read(unmoved, length):
    head = f"POST /api/decide HTTP/1.1\r\nHost: HOST\r\nCookie: {unmoved.cookie}\r\nContent-Type: application/json\r\n"
    answer = say(unmoved, (head + f"Content-Length: {length}\r\n\r\n").encode() + b"{}")
    assert answer.startswith(b"HTTP/1.1 413")
    assert is_well(unmoved)


@pytest.mark.parametrize("body", [b"{", b"[" * 50_000, b"\xff\xfe", b"nan", b"[]", b'"x"', b"null", b"1" * 20_000])
def test_what_is_no_decision_is_refused(unmoved, body):
    head = f"POST /api/decide HTTP/1.1\r\nHost: HOST\r\nCookie: {unmoved.cookie}\r\nContent-Type: application/json\r\n"
    answer = say(unmoved, (head + f"Content-Length: {len(body)}\r\n\r\n").encode() + body)
    assert answer[:12] in (b"HTTP/1.1 400", b"HTTP/1.1 404")
    assert b"Traceback" not in answer
    assert read_decisions(unmoved.session.run.folder) == []
    assert is_well(unmoved)


@pytest.mark.parametrize(
    "request_line",
    [
        b"", b"\r\n", b"GET", b"GET / HTTP/9.9", b"GET /" + b"a" * 70_000 + b" HTTP/1.1", b"\x16\x03\x01",
        b"\x00" * 99,
        b"PUT / HTTP/1.1", b"DELETE /api/decide HTTP/1.1", b"OPTIONS * HTTP/1.1", b"GET //evil.example/ HTTP/1.1",
        b"GET http://evil.example/ HTTP/1.1", b"GET /[ HTTP/1.1", b"GET /%zz?%00=%ff HTTP/1.1",
        b"GET /api/scene HTTP/1.1",
        b"GET /api/scene?track=" + b"9" * 5000 + b" HTTP/1.1", b"GET /api/place?index=-1 HTTP/1.1",
        b"GET /api/../../run.json HTTP/1.1", b"GET /..%2f..%2frun.json HTTP/1.1", b"GET /page%5creview.html HTTP/1.1",
    ],
)  # fmt: skip
def test_a_malformed_request_is_refused_and_the_next_is_answered(unmoved, request_line, capfd):
    head = b"\r\nHost: HOST\r\nCookie: " + unmoved.cookie.encode() + b"\r\nConnection: close\r\n\r\n"
    answer = say(unmoved, request_line + head)
    assert b" 200 " not in answer[:20]
    assert b"Traceback" not in answer
    assert is_well(unmoved)
    assert capfd.readouterr().err == ""


def test_headers_without_end_are_refused(server):
    many = b"".join(b"X-%d: %s\r\n" % (i, b"a" * 100) for i in range(300))
    assert say(server, b"GET / HTTP/1.1\r\nHost: HOST\r\n" + many + b"\r\n")[:12] in (b"HTTP/1.1 431", b"HTTP/1.1 400")
    assert is_well(server)


def test_a_request_that_falls_silent_is_hung_up_on(server, monkeypatch):
    monkeypatch.setattr(server_module._Handler, "timeout", 0.3)
    head = f"POST /api/decide HTTP/1.1\r\nHost: HOST\r\nCookie: {server.cookie}\r\nContent-Type: application/json\r\n"
    for begun in ("GET / HT", head, head + "Content-Length: 50\r\n\r\n{"):
        began = time.monotonic()
        say(server, begun.encode())
        assert time.monotonic() - began < 5.0
    assert read_decisions(server.session.run.folder) == []
    assert is_well(server)


def test_a_request_that_comes_byte_by_byte_is_hung_up_on(server, monkeypatch):
    monkeypatch.setattr(server_module._Handler, "timeout", 0.5)
    began = time.monotonic()
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=10) as connection:
        try:
            while time.monotonic() - began < 5.0:
                connection.sendall(b"G")
                time.sleep(0.1)
        except OSError:  # hung up on
            pass
    assert time.monotonic() - began < 5.0
    assert is_well(server)


def test_two_requests_of_one_connection_have_their_time_each(server, monkeypatch):
    monkeypatch.setattr(server_module._Handler, "timeout", 1.0)
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    for _ in range(3):
        connection.request("GET", "/api/status", headers={"Cookie": server.cookie})
        assert json.loads(connection.getresponse().read())
        time.sleep(0.6)
    connection.close()


@pytest.mark.slow
def test_connections_beyond_what_a_browser_makes_are_refused_and_no_thread_is_kept_for_them(server, monkeypatch):
    monkeypatch.setattr(server_module._Handler, "timeout", 1.0)
    before = threading.active_count()
    many = server_module.MAX_CONNECTIONS + 40
    half_open = [socket.create_connection(("127.0.0.1", server.server_port), timeout=10) for _ in range(many)]
    time.sleep(0.3)
    assert threading.active_count() - before <= server_module.MAX_CONNECTIONS
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline:  # those that keep silent are hung up on, and room is made
        try:
            assert is_well(server)
            break
        except OSError:
            time.sleep(0.1)
    else:
        pytest.fail("half-open connections keep others out")
    for connection in half_open:
        connection.close()


def test_hostile_requests_at_the_same_time_leave_one_log_of_whole_lines(server):
    def decide(verdict):
        for _ in range(5):
            ask(server, "/api/decide", {"track": 1, "verdict": verdict})
            ask(server, "/api/decide", {"track": [], "verdict": verdict})

    threads = [threading.Thread(target=decide, args=(verdict,)) for verdict in ("static", "moving", "unknown", 7)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(read_decisions(server.session.run.folder)) == 15
    assert is_well(server)
