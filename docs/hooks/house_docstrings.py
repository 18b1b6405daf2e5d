"""Docstrings for mkdocstrings: numpydoc as it is, and the short form that private functions use.

In the short form, `name : what it is` describes a value, whose type is in the signature. numpydoc would take the text
behind the colon for a type, so it is moved to the line below, where numpydoc has descriptions.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import griffe

_SECTIONS = {"Parameters", "Attributes", "Raises"}
_ITEM = re.compile(r"^(?P<names>\*{0,2}\w+(?:, \w+)*) : (?P<text>.+)$")
_NEXT_ON_LINE = re.compile(r"(?<=\S)   (?=\w+(?:, \w+)* : )")
_LONGEST_TYPE = 100
"""Characters: a longer line is a description that goes on in the next."""


class HouseStyle(griffe.Extension):
    """Rewrites docstrings in the short form before they are parsed."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Rewrite the docstring of one module, class, function or attribute."""
        if obj.docstring is not None:
            obj.docstring.value = described(obj.docstring.value)


def described(text: str) -> str:
    """Return a docstring with the descriptions of parameters, attributes and errors on lines of their own."""
    lines = text.splitlines()
    items = set(_items(lines))
    if all(_is_type(lines, number) for number in items):
        return text
    out = []
    for number, line in enumerate(lines):
        if number not in items:
            out.append(line)
            continue
        for item in _NEXT_ON_LINE.split(line):
            names, _, words = item.partition(" : ")
            out += [names, f"    {words}"]
    return "\n".join(out)


def _items(lines: list[str]) -> Iterator[int]:
    """Yield the numbers of the lines that name a value or an error."""
    section = ""
    for number, line in enumerate(lines):
        following = lines[number + 1] if number + 1 < len(lines) else ""
        if following and set(following) == {"-"}:
            section = line.strip()
        if section in _SECTIONS and _ITEM.match(line):
            yield number


def _is_type(lines: list[str], number: int) -> bool:
    """Return whether an item is numpydoc's: a type after the colon, the description on the next line."""
    following = lines[number + 1] if number + 1 < len(lines) else ""
    return following.startswith("    ") and len(lines[number]) <= _LONGEST_TYPE
