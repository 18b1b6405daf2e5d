"""Self-contained pages, and the report of a run: one HTML page with figures, warnings, curves and an animated map.

Styles, scripts and data are written into one file. The plots are a few hundred lines of canvas and SVG: a plotting
library would take four fifths of the page's five megabytes, and none of them draws an animated map beside its charts.
"""

import html
import json
import re
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

from automos import __version__
from automos.core.arguments import require_kind
from automos.core.atomic import write_text
from automos.core.claims import claim_file
from automos.core.reading import given_path
from automos.results.run_files import RunFiles
from automos.views.survey import survey

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


def write_report(run: RunFiles, path: str | Path) -> None:
    """Write a run as one HTML page, which needs neither a server nor a network.

    Parameters
    ----------
    run : RunFiles
        Result of `automos.label` or `automos.load`.
    path : str or Path
        HTML file to write. It is written completely or not at all.

    Raises
    ------
    InputError
        Results are missing or damaged, or the file cannot be written.

    Examples
    --------
    >>> import automos
    >>> automos.write_report(automos.load("automos_runs/my_log"), "report.html")
    """
    require_kind(run, RunFiles, "run", "what automos.label or automos.load returns")
    target = given_path(path, "the file of a report")
    claim_file(target, b"AutoMOS report</title>")
    data = survey(run)
    data["made"] = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    data["version"] = __version__
    title, content = html.escape(str(data["name"])), script_json(data)
    write_text(target, filled(inline(page_text("report.html")), title=title, data=content))
