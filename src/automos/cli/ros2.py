"""The command `ros2`: label the clouds of a robot, as a node of its ROS 2."""

import typer

from automos.cli.consoles import console, output
from automos.cli.options import Lag, Overrides, SettingsFile

ros2_app = typer.Typer()


@ros2_app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})
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
    import automos
    from automos.compiling import LINE, is_cold
    from automos.live.ros2.feed import RosFeed
    from automos.live.ros2.publishing import Publisher
    from automos.live.run import run_live
    from automos.settings import load_settings, read_overrides

    chosen = load_settings("default", settings, read_overrides(set_))
    feed = RosFeed(ctx.args)
    try:
        publish = Publisher(feed)
        console.print(LINE if is_cold() else "getting ready", markup=False)
        labeler = automos.Labeler(chosen, lag=lag)
        labeler.warm_up()
        console.print(f"waiting for clouds on {feed.topic} (Ctrl-C ends it)", markup=False)
        tally = run_live(feed, labeler, [publish])
    finally:
        feed.close()
    for sentence in (tally.sentence(feed.name), feed.summary()):
        output.print(sentence, markup=False)
