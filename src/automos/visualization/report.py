"""A run as one HTML page that needs no network and no server: for whoever has to trust the labels.

The plots are a few hundred lines of canvas and SVG of our own: a plotting library would be four fifths of the page's
five megabytes, and none of them draws a map that plays back beside its charts.
"""

from __future__ import annotations

import html
from datetime import UTC, datetime
from pathlib import Path

from automos import __version__
from automos.arguments import given_path, require_kind
from automos.atomic import write_text
from automos.results.claiming import refuse_file_of
from automos.results.run_files import RunFiles
from automos.visualization.page_files import inline, page_text, script_json
from automos.visualization.survey import survey


def write_report(run: RunFiles, path: str | Path) -> None:
    """Write the report of `run` to the HTML file `path`, whole or not at all.

    Raises
    ------
    InputError
        Results that are missing or damaged, or a file that cannot be written.
    """
    require_kind(run, RunFiles, "run", "what automos.open_run returns")
    target = given_path(path, "the file of a report")
    refuse_file_of(run.sequence, target)
    data = survey(run)
    data["made"] = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    data["version"] = __version__
    page = inline(page_text("report.html")).replace("{{title}}", html.escape(str(data["name"])))
    write_text(target, page.replace("{{data}}", script_json(data)))
