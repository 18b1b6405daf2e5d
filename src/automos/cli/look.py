"""The commands `report`, `review` and `view`: show results."""

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from automos.cli.options import Format, Moved, app, console, output, progress_of

Run = Annotated[Path, typer.Argument(metavar="RUN", help="a results folder of automos label")]


@app.command()
def report(
    results: Run,
    recording: Moved = None,
    out: Annotated[Path | None, typer.Option(help="HTML file to write; default: RUN/report.html")] = None,
    format: Format = None,
) -> None:
    """Write one HTML page about a run: what moved, where, with which confidence and score. It needs no network."""
    from automos.results.open_run import open_run
    from automos.views.report import write_report

    path = out or results / "report.html"
    with progress_of(results.name) as progress:
        write_report(open_run(results, recording, format, progress), path)
    output.print(path)


@app.command()
def review(
    results: Run,
    recording: Moved = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="port on 127.0.0.1; 0: any free one")] = 0,
    browser: Annotated[bool, typer.Option(help="open the page in a browser")] = True,
    sample: Annotated[
        int | None, typer.Option(help="number of random looks, which estimate precision and recall")
    ] = None,
    format: Format = None,
) -> None:
    """Review the objects of a run, those with most doubtful points first, and add what was missed.

    Labels, tracks.json and the report are rewritten. Every decision is stored in RUN/review.jsonl and applies when
    the recording is labelled again.
    """
    import webbrowser

    from automos.core.atomic import held
    from automos.core.claims import RESULTS, claim
    from automos.results.open_run import open_run
    from automos.review.private_page import private_page
    from automos.review.server import ReviewServer
    from automos.review.session import Session

    run = open_run(results, recording, format)
    claim(results, RESULTS)
    with held(results):  # whoever writes there meanwhile would not know of what is decided here
        with progress_of(results.name) as progress:
            session = Session(run, progress, sample)
        server = ReviewServer(session, port)
        output.print(f"{server.url}  (Ctrl-C ends the review)")
        try:
            with private_page(results, server.url) if browser else nullcontext() as page:
                if page is not None and typer.launch(str(page)) != 0:
                    webbrowser.open(page.as_uri())
                server.serve_forever()
        except KeyboardInterrupt:
            console.print("writing what was decided")
        finally:
            server.server_close()
            session.close()


@app.command()
def view(
    results: Run,
    recording: Moved = None,
    rrd: Annotated[Path | None, typer.Option(help="write a file for the viewer instead of opening it")] = None,
    web: Annotated[bool, typer.Option("--web", help="show it in a browser, served on 127.0.0.1")] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="port of --web; 0: any free one")] = 0,
    browser: Annotated[bool, typer.Option(help="with --web, open a browser")] = True,
    points: Annotated[int, typer.Option(min=0, help="static points shown per scan, at most")] = 40_000,
    format: Format = None,
) -> None:
    """Show a run in the viewer Rerun: points by verdict, boxes, tracks, trajectory, errors if there is ground truth."""
    from automos.results.open_run import open_run
    from automos.views.viewer import Viewer, save_recording

    with progress_of(results.name) as progress:
        run = open_run(results, recording, format, progress)
        if rrd is not None:
            save_recording(run, rrd, points)
    if rrd is not None:
        output.print(rrd)
        return
    with Viewer(web, port) as viewer:
        if viewer.url is not None:
            output.print(f"{viewer.url}  (Ctrl-C ends the viewer)")
            if browser:
                typer.launch(viewer.url)
        try:
            viewer.send(run, points)
            viewer.wait()
        except KeyboardInterrupt:
            return
