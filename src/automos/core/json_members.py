"""JSON: its members one by one, as a long list in Python is ten times the text, and numbers that it has not."""

import json
import math
import re
from collections.abc import Iterator
from typing import Any

_SPACE = re.compile(r"[ \t\n\r]*")


def each_member(text: str, of_list: str) -> Iterator[tuple[str | None, Any]]:
    """Yield name and value of each member of the object in JSON `text`; what list `of_list` holds after it, as None.

    Raises
    ------
    ValueError
        It is not JSON, or no object, or nested too deeply. What was yielded before it was seen to be is JSON.
    """
    decode, at = json.JSONDecoder().raw_decode, 0

    def is_next(mark: str) -> bool:
        nonlocal at
        at = _SPACE.match(text, at).end()  # type: ignore[union-attr]
        is_there = text.startswith(mark, at)
        at += len(mark) * is_there
        return is_there

    def require(mark: str) -> None:
        if not is_next(mark):
            raise json.JSONDecodeError(f"Expecting {mark!r}", text, at)

    def value() -> Any:
        nonlocal at
        is_next("")
        try:
            found, at = decode(text, at)
        except RecursionError:
            raise ValueError("it is nested too deeply") from None
        return found

    def values(end: str) -> Iterator[Any]:
        if not is_next(end):
            yield value()
            while is_next(","):
                yield value()
            require(end)

    require("{")
    for name in values("}"):
        if not isinstance(name, str):
            raise ValueError(f"{name!r:.20} is not a name")
        require(":")
        if name == of_list and is_next("["):
            yield name, []
            yield from ((None, one) for one in values("]"))
        else:
            yield name, value()
    if not is_next("") or at < len(text):
        raise json.JSONDecodeError("Extra data", text, at)


def without_nan(value: Any) -> Any:
    """Return `value` with None in place of numbers that JSON has not."""
    if isinstance(value, dict):
        return {key: without_nan(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [without_nan(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
