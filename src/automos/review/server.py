"""The server of the review's page, for this machine only.

It is bound to 127.0.0.1, but the browser also shows pages of other origins, which can send requests to any address. So
a request is accepted only if it names this server as its host (a foreign name that resolves to 127.0.0.1 does not) and
comes from no other origin, and a decision only as JSON, which other origins cannot send without permission. Other
programs and users of this machine do not know the token at the end of the printed address; the page keeps it as a
cookie.
"""

import hmac
import io
import json
import logging
import secrets
import socket
import sys
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any
from urllib.parse import parse_qs, urlsplit

from automos.core.errors import AutomosError, InputError
from automos.core.reading import parse_json
from automos.review.api import ASKED, MAX_BODY, SAID
from automos.review.session import Session
from automos.views.report import page_text

_log = logging.getLogger(__name__)

HOST = "127.0.0.1"
PATIENCE = 10.0
"""Seconds until a request must have begun, and again until it must have come whole."""
MAX_CONNECTIONS = 64
"""At a time; a browser makes six."""
_OWN = {file.name: file for file in files("automos.review").joinpath("page").iterdir()}
_SHARED = ("look.css", "look.js")
_GUARDS = {
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src data:",
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""What keeps other pages from showing or using an answer."""
_KINDS = {"html": "text/html", "css": "text/css", "js": "text/javascript", "json": "application/json"}


class ReviewServer(ThreadingHTTPServer):
    """Serves one session on 127.0.0.1."""

    daemon_threads = True

    def __init__(self, session: Session, port: int = 0):
        """Listen on `port`, any free one if 0.

        Raises
        ------
        InputError
            The port is taken.
        """
        try:
            super().__init__((HOST, port), _Handler)
        except OSError as error:
            raise InputError(
                f"port {port} cannot be used ({error.strerror}); choose another --port, or none"
            ) from error
        self.session = session
        self.token = secrets.token_urlsafe(24)
        self._free = threading.BoundedSemaphore(MAX_CONNECTIONS)

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{HOST}:{self.server_port}/?token={self.token}"

    @property
    def cookie(self) -> str:
        """The cookie of an authorised request; cookies do not distinguish ports, so its name does."""
        return f"automos{self.server_port}={self.token}"

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread of its own, or not at all while too many are open."""
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer, then let the next one in."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing on the terminal of whoever hung up."""
        _log.debug("a request failed", exc_info=sys.exc_info())


class _InTime(io.RawIOBase):
    """What comes from a connection, until a request takes too long: one byte now and then must not hold a thread."""

    def __init__(self, connection: socket.socket, patience: float):
        self._connection, self._patience = connection, patience
        self.deadline: float | None = None

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        left = self._patience if self.deadline is None else self.deadline - time.monotonic()
        if left <= 0.0:
            raise TimeoutError
        self._connection.settimeout(left)
        n = self._connection.recv_into(buffer)
        self._connection.settimeout(self._patience)
        if self.deadline is None:
            self.deadline = time.monotonic() + self._patience
        return n


class _Handler(BaseHTTPRequestHandler):
    server: ReviewServer
    protocol_version = "HTTP/1.1"
    timeout = PATIENCE

    def setup(self) -> None:
        super().setup()
        self._in = _InTime(self.connection, self.timeout)
        self.rfile = io.BufferedReader(self._in)

    def handle_one_request(self) -> None:
        self._in.deadline = None
        super().handle_one_request()

    def do_GET(self) -> None:
        self._guarded(self._get)

    def do_POST(self) -> None:
        self._guarded(self._post)

    def _guarded(self, answer: Callable[[], None]) -> None:
        """Answer; whatever a request makes stumble is refused in a sentence."""
        try:
            answer()
        except AutomosError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))
        except (ConnectionError, TimeoutError):
            self.close_connection = True
        except Exception:
            _log.debug("%s cannot be answered", self.path, exc_info=True)
            self.close_connection = True
            self._refuse(HTTPStatus.BAD_REQUEST, "that cannot be answered")

    def _get(self) -> None:
        if not self._is_ours():
            return
        url = urlsplit(self.path)
        name = url.path.lstrip("/") or ("review.html" if self.server.session.looking is None else "sample.html")
        if name in _OWN:
            self._send(_OWN[name].read_text(encoding="utf-8"), name)
        elif name in _SHARED:
            self._send(page_text(name), name)
        elif (ask := ASKED.get(name.removeprefix("api/"))) and name.startswith("api/"):
            self._send(json.dumps(ask(self.server.session, parse_qs(url.query))), "answer.json")
        else:
            self._refuse(HTTPStatus.NOT_FOUND, "there is no such page")

    def _post(self) -> None:
        self.close_connection = True  # whatever is refused, its body is not read
        if not self._is_ours():
            return
        if self.headers.get_content_type() != "application/json":
            return self._refuse(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "decisions come as JSON")
        size = self.headers.get("Content-Length", "")
        if not (size.isascii() and size.isdigit() and len(size) < 9 and int(size) <= MAX_BODY):
            return self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "that is not a decision")
        try:
            body = parse_json(self.rfile.read(int(size)) or b"{}")
        except ValueError:
            return self._refuse(HTTPStatus.BAD_REQUEST, "that is not JSON")
        say = SAID.get(self.path.removeprefix("/api/"))
        if say and self.path.startswith("/api/") and isinstance(body, dict):
            return self._send(json.dumps(say(self.server.session, body) or {}), "answer.json")
        return self._refuse(HTTPStatus.NOT_FOUND, "there is nothing to decide here")

    # ------------------------------------------------------------------------------------------------- in and out
    def _is_ours(self) -> bool:
        """Return whether the request comes from the page itself; refuse it otherwise."""
        port = self.server.server_port
        hosts = {f"{HOST}:{port}", f"localhost:{port}"}
        origins = {None, *(f"http://{host}" for host in hosts)}
        is_here = self.headers.get("Host") in hosts and self.headers.get("Origin") in origins
        is_of_page = self.headers.get("Sec-Fetch-Site", "none") in ("none", "same-origin") or self._is_by_private_page()
        if not (is_here and is_of_page and self.path.startswith("/")):
            why = "only the page itself may ask"
        elif not self._knows_token():
            why = "open the address that automos review printed, with its token"
        else:
            return True
        self.close_connection = True
        self._refuse(HTTPStatus.FORBIDDEN, why)
        return False

    def _is_by_private_page(self) -> bool:
        """Return whether the page is opened by its whole address, as by `private_page`, which is of no site."""
        is_opened = self.command == "GET" and self.headers.get("Sec-Fetch-Mode") == "navigate"
        return is_opened and hmac.compare_digest(self.path.encode(), f"/?token={self.server.token}".encode())

    def _knows_token(self) -> bool:
        name, _, token = self.server.cookie.partition("=")
        try:
            kept = SimpleCookie(self.headers.get("Cookie", "")).get(name)
        except CookieError:
            kept = None
        # The page of an earlier review at this port may have left another one.
        given = [*parse_qs(urlsplit(self.path).query).get("token", [])[:1], *([] if kept is None else [kept.value])]
        return any(hmac.compare_digest(one.encode(), token.encode()) for one in given)

    def _refuse(self, status: HTTPStatus, why: str) -> None:
        self._send(json.dumps({"error": why}), "error.json", status)

    def _send(self, text: str, name: str, status: HTTPStatus = HTTPStatus.OK) -> None:
        content = text.encode()
        self.send_response(status)
        headers = {
            "Content-Type": f"{_KINDS[name.rsplit('.', 1)[-1]]}; charset=utf-8",
            "Content-Length": str(len(content)),
            **_GUARDS,
        }
        if name.endswith(".html"):
            headers["Set-Cookie"] = f"{self.server.cookie}; HttpOnly; SameSite=Strict; Path=/"
            headers["Referrer-Policy"] = "no-referrer"
        if self.close_connection:
            headers["Connection"] = "close"
        for header in headers.items():
            self.send_header(*header)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        _log.debug(format, *args)
