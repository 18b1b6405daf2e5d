"""The command `live`: label the scans of a running sensor."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from automos.cli.consoles import console, output
from automos.cli.options import Format, Overrides, SettingsFile

if TYPE_CHECKING:
    from automos.live.feed import Feed
    from automos.live.message import Sender
    from automos.live.run import Sink, Tally

live_app = typer.Typer()


@live_app.command()
def live(
    source: Annotated[str, typer.Argument(help="udp://HOST:PORT of a sensor's packets, or a recording to replay")],
    sensor: Annotated[str | None, typer.Option(help="the sensor's manufacturer: velodyne or ouster")] = None,
    metadata: Annotated[Path | None, typer.Option(help="ouster: the sensor's metadata, a JSON file")] = None,
    lag: Annotated[float, typer.Option(help="seconds by which labels may come later than their scan")] = 0.0,
    out: Annotated[Path | None, typer.Option(help="results folder to write labels, poses and tracks to")] = None,
    send: Annotated[str | None, typer.Option(help="udp://HOST:PORT to send a message per scan to")] = None,
    view: Annotated[bool, typer.Option("--view", help="show it in the viewer, in a window")] = False,
    web: Annotated[bool, typer.Option("--web", help="show it in a browser, served on 127.0.0.1")] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="port of --web; 0: any free one")] = 0,
    browser: Annotated[bool, typer.Option(help="with --web, open a browser")] = True,
    points: Annotated[int, typer.Option(min=0, help="static points shown per scan, at most")] = 20_000,
    speed: Annotated[float, typer.Option(min=0.0, help="rate of a replay; 0: fastest, nothing left out")] = 1.0,
    timeout: Annotated[float, typer.Option(min=0.1, help="seconds without packets after which it ends")] = 10.0,
    format: Format = None,
    settings: SettingsFile = None,
    set_: Overrides = None,
) -> None:
    """Label the scans of a running sensor; show, write or send the results. Ctrl-C ends it.

    [bold]Examples[/bold]

    automos live udp://127.0.0.1:2368 --sensor velodyne --view

    automos live udp://0.0.0.0:7502 --sensor ouster --metadata os1.json --lag 0.5 --send udp://127.0.0.1:9050

    automos live my_log/ --web                     a recording, replayed at its own rate
    """
    import automos
    from automos.compiling import LINE, is_cold
    from automos.core.errors import InputError
    from automos.live.opening import open_feed
    from automos.live.run import run_live
    from automos.live.segment import results_writer
    from automos.settings import load_settings, read_overrides

    if not 0.0 <= lag < float("inf"):
        raise InputError(f"--lag is {lag:g}: give 0 or some seconds")
    chosen = load_settings("default", settings, read_overrides(set_))
    feed = open_feed(source, sensor, metadata, speed, timeout, format)
    names: list[str] = []
    with ExitStack() as stack:
        stack.callback(feed.stop)
        sender = None if send is None else _sender(send, stack)
        sinks: list[Sink] = [] if sender is None else [_sending(sender)]
        if view or web:
            sinks.append(_showing(feed.name, web, port, browser, points, stack))
        if out is not None:  # it is emptied, so whatever may be wrong with the command was looked at before
            writer = stack.enter_context(results_writer(out, names, chosen, feed.recording))
            sinks.insert(0, lambda scan, given: writer.write(given))
        console.print(LINE if is_cold() else "getting ready", markup=False)
        labeler = automos.Labeler(chosen, lag=lag, is_compensated=feed.is_compensated)
        labeler.warm_up()
        tally = run_live(feed, labeler, sinks, names, _Line(feed.name))
        if out is not None:
            writer.finish(_about(feed, tally, lag))
    where = "" if out is None else f"labels in {out}/predictions"
    for sentence in filter(None, (tally.sentence(feed.name), feed.summary(), sender and sender.summary(), where)):
        output.print(sentence)


def _about(feed: Feed, tally: Tally, lag: float) -> dict[str, Any]:
    """Return what run.json says of a live run."""
    counts = {"scans": tally.labelled, "left_out": tally.left_out}
    return {"recording": {"name": feed.name, **counts, "is_sensor": feed.recording is None}, "lag_seconds": lag}


def _sender(address: str, stack: ExitStack) -> Sender:
    from automos.live.message import Sender
    from automos.live.udp import parse_address

    return stack.enter_context(Sender(*parse_address(address)))


def _sending(sender: Sender) -> Sink:
    return lambda scan, given: sender.send(given)


def _showing(name: str, web: bool, port: int, browser: bool, points: int, stack: ExitStack) -> Sink:
    from automos.views.live import LiveView
    from automos.views.viewer import Viewer

    viewer = stack.enter_context(Viewer(web, port, memory="1GB"))
    if viewer.url is not None:
        output.print(viewer.url)
        if browser:
            typer.launch(viewer.url)
    shown = LiveView(viewer, name, points)
    stack.callback(shown.close)  # before the viewer itself
    return shown.show


class _Line:
    """Says every few seconds how it goes, where nobody looks at a viewer."""

    EVERY = 5.0

    def __init__(self, name: str):
        self._name, self._next = name, 0.0

    def __call__(self, tally: Tally) -> None:
        if tally.labelled == 0 and not self._next:
            console.print(f"{self._name}: waiting for scans (Ctrl-C ends it)", markup=False)
        elif time.monotonic() >= self._next:
            console.print(
                f"{tally.labelled} scans labelled, {tally.left_out} left out, {tally.milliseconds[-1]:.0f} ms the last",
                markup=False,
            )
        else:
            return
        self._next = time.monotonic() + self.EVERY
