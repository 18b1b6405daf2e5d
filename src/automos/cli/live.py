"""The commands `live` and `ros2`: label the scans of a running sensor, or the clouds of a robot's ROS 2."""

from __future__ import annotations

import gc
import time
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from automos.cli.options import Format, Lag, Overrides, Rate, SettingsFile, app, console, output, read_settings
from automos.core.errors import plain

if TYPE_CHECKING:
    from automos.labeler import Labeler
    from automos.live.run import Sink, Tally
    from automos.settings import Settings


@app.command()
def live(
    source: Annotated[str, typer.Argument(help="udp://HOST:PORT of a sensor's packets, or a recording to replay")],
    sensor: Annotated[str | None, typer.Option(help="its manufacturer: velodyne or ouster")] = None,
    metadata: Annotated[Path | None, typer.Option(help="ouster: the sensor's metadata, a JSON file")] = None,
    lag: Lag = 0.0,
    out: Annotated[Path | None, typer.Option(help="results folder to write labels, poses and tracks to")] = None,
    send: Annotated[str | None, typer.Option(help="udp://HOST:PORT to send a message per scan to")] = None,
    view: Annotated[bool, typer.Option("--view", help="show it in the viewer, in a window")] = False,
    web: Annotated[bool, typer.Option("--web", help="show it in a browser, served on 127.0.0.1")] = False,
    foxglove: Annotated[bool, typer.Option("--foxglove", help="instead, serve it to Foxglove or Lichtblick")] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="port of --web or --foxglove; 0: any free one")] = 0,
    browser: Annotated[bool, typer.Option(help="with --web, open a browser")] = True,
    points: Annotated[int, typer.Option(min=0, help="static points shown per scan, at most")] = 20_000,
    speed: Annotated[float, typer.Option(min=0.0, help="rate of a replay, at most; 0: fastest")] = 1.0,
    timeout: Annotated[float, typer.Option(min=0.1, help="seconds without packets after which it ends")] = 10.0,
    format: Format = None,
    rate: Rate = None,
    settings: SettingsFile = None,
    set_: Overrides = None,
) -> None:
    """Label the scans of a running sensor; show, write or send the results. Ctrl-C ends it.

    [bold]Examples[/bold]

    automos live udp://127.0.0.1:2368 --sensor velodyne --view

    automos live udp://0.0.0.0:7502 --sensor ouster --metadata os1.json --lag 0.5 --send udp://127.0.0.1:9050

    automos live my_log/ --web                     a recording, replayed at its own rate
    """
    from automos.live.message import Sender
    from automos.live.opening import open_feed
    from automos.live.run import run_live
    from automos.live.segment import results_writer
    from automos.live.udp import parse_address

    chosen = read_settings(settings, set_, {"recording.rate": rate})
    feed = open_feed(source, sensor, metadata, speed, timeout, format)
    names: list[str] = []
    with ExitStack() as stack:
        stack.callback(feed.stop)
        sender = None if send is None else stack.enter_context(Sender(*parse_address(send)))
        sinks: list[Sink] = [] if sender is None else [lambda scan, given: sender.send(given)]
        if view or web or foxglove:
            show = _serving if foxglove else partial(_showing, web, browser, points)
            sinks += [show(feed.name, port, stack)]
        if out is not None:  # it is emptied, so whatever may be wrong with the command was looked at before
            writer = stack.enter_context(results_writer(out, names, chosen, feed.recording))
            sinks.insert(0, lambda scan, given: writer.write(given))
        labeler = _ready_labeler(chosen, lag, feed.is_compensated)
        tally = run_live(feed, labeler, sinks, names, _Line(feed.name, stack))
        if out is not None:
            counts = {"scans": tally.labelled, "left_out": tally.left_out}
            about = {"name": feed.name, **counts, "is_sensor": feed.recording is None}
            writer.finish({"recording": about, "lag_seconds": lag})
    where = "" if out is None else f"labels in {out}/predictions"
    for sentence in filter(None, (tally.sentence(feed.name), feed.summary(), sender and sender.summary(), where)):
        output.print(sentence)


def _ready_labeler(settings: Settings, lag: float, is_compensated: bool | None = None) -> Labeler:
    """Return a labeler that has loaded, or compiled, all that it needs."""
    from automos.compiling import LINE, is_cold
    from automos.labeler import Labeler

    console.print(LINE if is_cold() else "getting ready", markup=False)
    labeler = Labeler(settings, lag=lag, is_compensated=is_compensated)
    labeler.warm_up()
    gc.collect()
    gc.freeze()  # to look through all that is loaded takes as long as a scan
    return labeler


def _showing(web: bool, browser: bool, points: int, name: str, port: int, stack: ExitStack) -> Sink:
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


def _serving(name: str, port: int, stack: ExitStack) -> Sink:
    from automos.views.live import FoxgloveView

    served = FoxgloveView(name, port)
    stack.callback(served.close)
    output.print(f"open {served.url} in Foxglove or Lichtblick (Foxglove WebSocket)", markup=False)
    return served.show


class _Line:
    """Says on one line how it goes; every few seconds on a new one where there is no terminal."""

    EVERY = 5.0

    def __init__(self, name: str, stack: ExitStack):
        self._name, self._next = plain(name), 0.0
        self._shown = stack.enter_context(console.status("getting ready")) if console.is_terminal else None

    def __call__(self, tally: Tally) -> None:
        how = tally.line() if tally.labelled else "waiting for scans (Ctrl-C ends it)"
        if self._shown is not None:
            self._shown.update(escape(f"{self._name}: {how}"))
        elif time.monotonic() >= self._next:
            console.print(f"{self._name}: {how}", markup=False, highlight=False)
            self._next = time.monotonic() + self.EVERY * (tally.labelled > 0)


@app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})
def ros2(
    ctx: typer.Context,
    lag: Lag = 0.0,
    settings: SettingsFile = None,
    set_: Overrides = None,
) -> None:
    """Label the clouds of topic points as a ROS 2 node. Ctrl-C ends it.

    Publishes ~/points_labelled, ~/points_static, ~/odometry, ~/boxes.

    [bold]Examples[/bold]

    automos ros2 --ros-args -r points:=/ouster/points

    automos ros2 --lag 0.5 --ros-args -r points:=/velodyne_points -p publish_odom_tf:=true
    """
    from automos.live.ros2.feed import RosFeed
    from automos.live.ros2.publishing import Publisher
    from automos.live.run import run_live

    chosen = read_settings(settings, set_)
    feed = RosFeed(ctx.args)
    try:
        publish = Publisher(feed)
        labeler = _ready_labeler(chosen, lag)
        console.print(f"waiting for clouds on {feed.topic} (Ctrl-C ends it)", markup=False)
        tally = run_live(feed, labeler, [publish])
    finally:
        feed.close()
    for sentence in (tally.sentence(feed.name), feed.summary()):
        output.print(sentence, markup=False)
