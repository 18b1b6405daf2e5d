"""Docstrings of this house for mkdocstrings: `name : what it is` describes a value, its type is in the signature.

numpy's style would take what stands behind the colon for a type. Here it is moved to the line below, where numpy's
style has descriptions.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

_SECTIONS = {"Parameters", "Attributes", "Raises"}
_ITEM = re.compile(r"^(?P<names>\*{0,2}\w+(?:, \w+)*) : (?P<text>.+)$")
_NEXT_ON_LINE = re.compile(r"(?<=\S)   (?=\w+(?:, \w+)* : )")


class HouseStyle(griffe.Extension):
    """Rewrites docstrings before they are parsed."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Rewrite the docstring of one module, class, function or attribute."""
        if obj.docstring is not None:
            obj.docstring.value = described(obj.docstring.value)


def described(text: str) -> str:
    """Return a docstring with the descriptions of parameters, attributes and errors on lines of their own."""
    lines, out, section = text.splitlines(), [], ""
    for number, line in enumerate(lines):
        following = lines[number + 1] if number + 1 < len(lines) else ""
        if following and set(following) == {"-"}:
            section = line.strip()
        found = section in _SECTIONS and _ITEM.match(line)
        if not found:
            out.append(line)
            continue
        for item in _NEXT_ON_LINE.split(line):
            names, _, words = item.partition(" : ")
            out += [names, f"    {words}"]
    return "\n".join(out)
