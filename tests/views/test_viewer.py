"""The viewer: a file with everything of a run in it, and a server for this machine alone."""

import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from automos.cli import app
from automos.core.errors import InputError, MissingExtraError
from automos.results.open_run import open_run
from automos.views import rerun_log
from automos.views.rerun_layout import blueprint
from automos.views.rerun_log import log_run, make_recording
from automos.views.topdown import FALSE, MISSED, MOVING, STATIC, UNLABELED, verdicts
from automos.views.viewer import Viewer, save_recording

rerun = pytest.importorskip("rerun", reason="the viewer is not installed: pip install '.[view]'")


def test_points_are_wrong_only_where_the_truth_says_so():
    labels = np.array([0, 9, 251, 9, 251, 251, 0], np.uint16)
    truth = np.array([9, 40, 252, 252, 40, 0, 251], np.uint32)
    assert verdicts(labels, truth).tolist() == [UNLABELED, STATIC, MOVING, MISSED, FALSE, MOVING, MISSED]
    assert verdicts(labels, None).tolist() == [UNLABELED, STATIC, MOVING, STATIC, MOVING, MOVING, UNLABELED]


def test_a_file_holds_points_boxes_tracks_trajectory_and_curves(lane_run, tmp_path):
    path = tmp_path / "lane.rrd"
    run = CliRunner().invoke(app, ["view", str(lane_run), "--rrd", str(path)])
    assert run.exit_code == 0, run.output
    told = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "print", path], capture_output=True, text=True, check=True
    )
    entities = ("world/points", "world/boxes/moving", "world/boxes/static", "world/tracks", "world/trajectory")
    for entity in (*entities, "world/unsure", "curves/moving_points", "curves/iou", "run"):
        assert f"/{entity}" in told.stdout


def test_curves_of_truth_are_laid_out_where_any_scan_has_it(lane_run, monkeypatch):
    run, laid_out = open_run(lane_run), []
    truth = run.sequence.truth
    monkeypatch.setattr(run.sequence, "truth", lambda index: None if index == 0 else truth(index))
    monkeypatch.setattr(rerun_log, "blueprint", lambda *given: laid_out.append(given[1]) or blueprint(*given))
    log_run(run, make_recording(run), 10)
    assert laid_out == [True]


def test_a_file_that_cannot_be_written_is_told(lane_run, tmp_path):
    with pytest.raises(InputError, match="no is not a folder; choose another --rrd"):
        save_recording(open_run(lane_run), tmp_path / "no" / "lane.rrd", 100)
    pytest.importorskip("rerun", reason="rerun is not installed: pip install '.[view]'")
    with pytest.raises(InputError, match="cannot be written"):
        save_recording(open_run(lane_run), Path("/proc/lane.rrd"), 100)  # where nobody may write


def test_without_rerun_the_command_to_install_it_is_told(lane_run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingExtraError, match=r"pip install '.*\[view\]'"):
        save_recording(open_run(lane_run), tmp_path / "lane.rrd", 100)


def listens(host, port):
    with socket.socket() as probe:
        probe.settimeout(0.5)
        return probe.connect_ex((host, port)) == 0


def ports_of(viewer):
    page = int(viewer.url.split("://127.0.0.1:")[1].split("/")[0])
    return page, viewer._port


def test_the_server_listens_on_this_machine_alone_and_ends_with_the_command():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("192.0.2.1", 9))  # sends nothing; tells the address others would reach this machine at
        outside = probe.getsockname()[0]
    if outside.startswith("127."):
        pytest.skip("this machine has no address but its own")
    with Viewer(web=True) as viewer:
        ports = ports_of(viewer)
        assert all(listens("127.0.0.1", port) for port in ports)
        assert not any(listens(outside, port) for port in ports)
    end = time.monotonic() + 5
    while any(listens("127.0.0.1", port) for port in ports):
        assert time.monotonic() < end


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a screen")
def test_without_a_screen_what_to_do_is_told(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(
        InputError, match=r"the viewer does not start \(.*\); without a screen, write a file with --rrd"
    ):
        Viewer()


@pytest.mark.slow
def test_a_viewer_that_was_closed_holds_up_nobody(lane_run):
    viewer = Viewer(web=True)
    viewer.close()
    start = time.monotonic()
    viewer.send(open_run(lane_run), 1000)
    assert time.monotonic() - start < 20


@pytest.mark.slow
@pytest.mark.browser
def test_a_browser_shows_the_points(chromium, lane_run):
    # Rerun's own page asks for fonts and news on the internet, so that its console is not a measure.
    import io

    import matplotlib.image

    with Viewer(web=True) as viewer:
        viewer.send(open_run(lane_run), 10_000)
        chromium.get(viewer.url)
        end = time.monotonic() + 120
        while time.monotonic() < end:
            time.sleep(2)
            image = matplotlib.image.imread(io.BytesIO(chromium.get_screenshot_as_png()))[..., :3]
            is_green = (
                (image[..., 1] > 1.5 * image[..., 0]) & (image[..., 1] > 1.5 * image[..., 2]) & (image[..., 1] > 0.3)
            )
            if is_green[:, : image.shape[1] // 2].sum() > 200:
                return
    pytest.fail("no green points were drawn")
