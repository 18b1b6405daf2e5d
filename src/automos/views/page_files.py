"""Self-contained pages: styles, scripts and data written into one HTML file."""

import json
import re
from importlib.resources import files
from typing import Any

_INLINE = re.compile(r"<!-- inline (?P<name>[\w.]+) -->")


def page_text(name: str) -> str:
    """Return the text of a style, script or page of this package, by file name."""
    return files("automos.views").joinpath("page", name).read_text(encoding="utf-8")


def inline(page: str) -> str:
    """Return `page` with every `<!-- inline FILE -->` replaced by that style or script."""

    def content(match: re.Match[str]) -> str:
        name = match["name"]
        tag = "style" if name.endswith(".css") else "script"
        return f"<{tag}>\n{page_text(name)}</{tag}>"

    return _INLINE.sub(content, page)


def filled(page: str, **values: str) -> str:
    """Return `page` with `values` in place of their names in double braces, which may be in the values, too."""
    return re.sub(r"{{(\w+)}}", lambda match: values[match[1]], page)


def script_json(data: Any) -> str:
    """Return `data` as JSON that is safe inside a script element, whatever its strings contain."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
