"""The requests of the page, by path: methods of the session, with checked arguments."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from automos.core.errors import InputError
from automos.core.geometry import FARTHEST
from automos.review.looking import Looking
from automos.review.session import Session

Body = Mapping[str, Any]
MAX_BODY = 200_000
"""Bytes that what the page says may have: a bulk decision names thousands of objects."""


def _propose(session: Session, body: Body) -> dict[str, Any]:
    where: dict[str, Any]
    if "boxes" in body:
        boxes = [one if isinstance(one, Mapping) else {} for one in _list(body, "boxes")]
        where = {"boxes": {number(one.get("index"), "a scan"): _box(one.get("box")) for one in boxes}}
    elif "place" in body:
        where = {"number": number(body["place"], "a place")}
    else:
        where = {"index": number(body.get("index"), "a scan"), "at": (_metres(body.get("x")), _metres(body.get("y")))}
    return session.propose(**where, is_glance=body.get("glance") is True)


def _tracks(body: Body) -> list[int]:
    return [number(track) for track in _list(body, "tracks")]


def _decide(session: Session, body: Body) -> None:
    tracks = _tracks(body) if "tracks" in body else [number(body.get("track"))]
    session.decide(tracks, str(body.get("verdict")))


def _accept(session: Session, body: Body) -> dict[str, Any]:
    first, last = (number(body.get(key), "a scan") for key in ("first", "last"))
    return {"id": session.accept(first, last, str(body.get("verdict", "moving")))}


def _cut(session: Session, body: Body) -> dict[str, Any]:
    return {"ids": session.cut(number(body.get("track")), number(body.get("index"), "a scan"))}


def _split(session: Session, body: Body) -> dict[str, Any]:
    return {"ids": session.split(number(body.get("track")), number(body.get("index"), "a scan"), _box(body.get("box")))}


def _looking(session: Session) -> Looking:
    if session.looking is None:
        raise InputError("no sample is drawn: run automos review with --sample 100")
    return session.looking


def _missed(session: Session, body: Body) -> dict[str, Any]:
    return _looking(session).missed(_look(body), _metres(body.get("x")), _metres(body.get("y")))


ASKED: dict[str, Callable[[Session, Mapping[str, list[str]]], dict[str, Any]]] = {
    "overview": lambda session, query: session.overview(),
    "following": lambda session, query: session.proposals.progress(),
    "status": lambda session, query: session.status(),
    "pictures": lambda session, query: session.pictures_now(),
    "scene": lambda session, query: session.scene(number(query.get("track", [""])[0])),
    "sample": lambda session, query: _looking(session).overview(),
    "look": lambda session, query: _looking(session).look(number(query.get("look", [""])[0], "a look")),
    "place": lambda session, query: session.place(number(query.get("index", [""])[0], "a scan")),
}
"""What is asked (GET), given what stands in the address after the question mark."""

Say = Callable[[Session, Body], dict[str, Any] | None]


def _with_status(say: Say) -> Say:
    """Return what answers as `say` does, and with what has changed by it."""
    return lambda session, body: {**(say(session, body) or {}), **session.status()}


SAID: dict[str, Say] = {
    "decide": _with_status(_decide),
    "propose": _propose,
    "ahead": lambda session, body: session.make_ahead([number(one, "a place") for one in _list(body, "places")]),
    "cancel": lambda session, body: session.proposals.cancel(),
    "accept": _with_status(_accept),
    "cut": _with_status(_cut),
    "split": _with_status(_split),
    "join": _with_status(lambda session, body: {"id": session.join(_tracks(body))}),
    "dismiss": _with_status(lambda session, body: session.dismiss(number(body.get("place"), "a place"))),
    "finish": _with_status(lambda session, body: session.finish()),
    "answer": lambda session, body: _looking(session).answer(_look(body), str(body.get("answer"))),
    "missed": _missed,
    "forget": lambda session, body: _looking(session).forget(_look(body)),
}
"""What is said (POST), given the body as JSON; nothing is answered where there is nothing to say."""


def _look(body: Mapping[str, Any]) -> int:
    return number(body.get("look"), "a look")


def number(value: Any, what: str = "an object") -> int:
    """Return `value` as the number of an object, a scan or a place; InputError if it is none."""
    try:
        found = int(value)
        if isinstance(value, bool) or found != float(value):
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{value!r:.80} is not the number of {what}") from None
    return found


def _metres(value: Any) -> float:
    try:
        found = float(value)
    except (TypeError, ValueError, OverflowError):
        found = math.nan
    if not abs(found) < FARTHEST:
        raise InputError(f"{value!r:.80} is not a number of metres")
    return found


def _box(values: Any) -> list[float]:
    if not isinstance(values, list) or len(values) != 5:
        raise InputError("a drawn box has five numbers: x, y, length, width, yaw")
    return [_metres(value) for value in values]


def _list(body: Body, name: str) -> list[Any]:
    if not isinstance(body.get(name), list):
        raise InputError(f"{name} is not a list")
    return list(body[name])
