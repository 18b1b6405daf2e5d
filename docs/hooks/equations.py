"""The equations of a page as MathML, which browsers draw themselves; GitHub draws the same text."""

from __future__ import annotations

import re
from typing import Any

from latex2mathml.converter import convert


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return a page with its blocks ```math and its $inline$ formulas as MathML."""
    blocks = re.split(r"(^```.*?^```$|`[^`\n]*`)", markdown, flags=re.M | re.S)
    return "".join(_formulas(part) for part in blocks)


def _formulas(part: str) -> str:
    if part.startswith("```math"):
        return f"<div>{convert(part.removeprefix('```math').removesuffix('```').strip(), display='block')}</div>"
    if part.startswith("`"):
        return part
    return re.sub(r"\$([^$\n]+)\$", lambda found: convert(found[1]), part)
