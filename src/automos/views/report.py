"""The report of a run: one HTML page with figures, warnings, curves and an animated map.

The plots are a few hundred lines of canvas and SVG: a plotting library would take four fifths of the page's five
megabytes, and none of them draws an animated map beside its charts.
"""

import html
from datetime import UTC, datetime
from pathlib import Path

from automos import __version__
from automos.core.arguments import given_path, require_kind
from automos.core.atomic import write_text
from automos.core.claims import claim_file
from automos.results.run_files import RunFiles
from automos.views.page_files import filled, inline, page_text, script_json
from automos.views.survey import survey


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
