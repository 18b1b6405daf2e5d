"""Makes the pictures of the docs from a simulated street: the steps of the method, and the pages a user sees.

    python docs/pictures.py            writes docs/images/{step_*,paper,report,review,viewer}.png
    python docs/pictures.py review     that one alone

The steps need nothing but AutoMOS; the pages need chromium, chromium-driver and selenium, the viewer rerun-sdk too.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from automos import simulation
from automos.baselines import erasor
from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.core.scan import OBJECT
from automos.labeling import label_recording
from automos.objects.verdict import Verdict
from automos.readers import open_sequence
from automos.results.open_run import open_run
from automos.review.run_stages import RunStages
from automos.review.server import ReviewServer
from automos.review.session import Session
from automos.settings import load_settings
from automos.views.report import write_report
from automos.views.topdown import COLORS, View
from automos.views.viewer import Viewer

IMAGES = Path(__file__).parent / "images"
SCANS, SCAN, RADIUS = 50, 14, 38.0
GREEN, GREY, AMBER, FAINT = COLORS["true moving"], "#9aa0a6", "#d98a00", "#e3e6e8"


def main() -> None:
    """Simulate, label, and draw everything, or what is named."""
    wanted = sys.argv[1:] or ["steps", "paper", "report", "review", "viewer"]
    with tempfile.TemporaryDirectory() as folder:
        if "paper" in wanted:
            world = simulation.simulate("waiting", "HDL-64E", SCANS, 3)
            label_recording(world, Path(folder) / "paper", load_settings("paper"))
            draw_paper(RunStages(Path(folder) / "paper", world), world)
        if wanted == ["paper"]:
            return
        recording, run = Path(folder) / "street", Path(folder) / "run"
        simulation.write(simulation.simulate("city", "HDL-64E", SCANS, 3), recording)
        label_recording(open_sequence(recording), run, load_settings("default"))
        if "steps" in wanted:
            draw_steps(RunStages(run, open_sequence(recording)), open_sequence(recording))
        shot = Browser()
        for draw in (draw_report, draw_review, draw_viewer):
            if draw.__name__.removeprefix("draw_") in wanted:
                draw(run, shot)
        shot.page.quit()


# ------------------------------------------------------------------------------------------------- steps
def draw_steps(stages: RunStages, sequence) -> None:
    """Draw what each stage found."""
    frame = stages.frame(SCAN)
    points, path = frame.points_level, stages.trajectory.T_level_sensor[:, :3, 3]
    center = path[SCAN]
    score = stages.stage("candidates").load(stages.names[SCAN], "score")["score"]
    found = stages.stage("instances").load(stages.names[SCAN], "ids", "stayed")
    ids = np.where(found["ids"] >= 0, found["ids"], found["stayed"])

    every = np.concatenate([stages.frame(i).points_level[::12] for i in range(0, SCANS, 2)])
    shade = np.clip(every[:, 2] / 3.0, 0.0, 1.0)
    with Picture("step_poses", center, 60.0) as axis:
        axis.scatter(*every[:, :2].T, s=0.12, c=0.85 - 0.6 * shade, cmap="gray", vmin=0, vmax=1, linewidths=0)
        axis.plot(*path[:, :2].T, color=COLORS["missed"], linewidth=2)
    is_ground = stages.stage("candidates").load(stages.names[SCAN], "kind")["kind"] != OBJECT
    with Picture("step_candidates", center) as axis:
        axis.scatter(*points[is_ground, :2].T, s=0.3, color=FAINT, linewidths=0)
        for color, low, high in ((GREY, 0, 96), (AMBER, 96, 160), (GREEN, 160, 256)):
            mask = ~is_ground & (score >= low) & (score < high)
            axis.scatter(*points[mask, :2].T, s=1.6, color=color, linewidths=0)
    with Picture("step_instances", center) as axis:
        axis.scatter(*points[ids < 0, :2].T, s=0.3, color=FAINT, linewidths=0)
        hues = np.random.default_rng(4).permutation(int(ids.max()) + 1) % 20
        inside = ids >= 0
        axis.scatter(*points[inside, :2].T, s=1.4, c=hues[ids[inside]], cmap="tab20", linewidths=0)
    tracks, verdict = stages.tracks, stages.verdicts.verdict
    with Picture("step_tracks", center) as axis:
        axis.scatter(*points[:, :2].T, s=0.3, color=FAINT, linewidths=0)
        for k in range(len(tracks)):
            middles = tracks.center[tracks.rows_of(k), :2]
            if verdict[k] == Verdict.MOVING:
                axis.plot(*middles.T, color=GREEN, linewidth=2.2)
                axis.plot(*middles[-1], "o", color=GREEN, markersize=5)
            else:
                axis.plot(*np.median(middles, axis=0), "o", color="#7d868d", markersize=3)
        axis.plot(*path[:, :2].T, color=COLORS["missed"], linewidth=2)
    labels, truth = stages.labels(SCAN)["label"], to_mos(sequence.truth(SCAN))
    with Picture("step_labels", center) as axis:
        view = View("", points, labels[frame.kept], truth[frame.kept])
        for kind, mask in view.kinds().items():
            axis.scatter(*points[mask, :2].T, s=0.2 if kind == "true static" else 3.0, color=COLORS[kind], linewidths=0)


def draw_paper(stages: RunStages, world: simulation.SimulatedSequence) -> None:
    """Draw what ERASOR found of the movers that a standing sensor saw, and its bins."""
    scan, bins = SCANS // 2, erasor.Parameters()
    frame = stages.frame(scan)
    points, center = frame.points_level, frame.origin_level
    is_moving = to_mos(world.truth(scan))[frame.kept] == Label.MOVING
    is_found = stages.stage("candidates").load(stages.names[scan], "log_odds")["log_odds"] > 0.0
    with Picture("paper", center, 24.0) as axis:
        angles = np.linspace(0.0, 2.0 * np.pi, bins.sectors, endpoint=False)
        for angle in angles:
            way = np.array([bins.max_range / bins.rings, bins.max_range])
            axis.plot(center[0] + way * np.cos(angle), center[1] + way * np.sin(angle), color=FAINT, linewidth=0.5)
        for radius in (bins.ego_radius, *(bins.max_range / bins.rings * np.arange(1, bins.rings + 1))):
            ring = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 200)) * radius
            color = GREY if radius == bins.ego_radius else FAINT
            axis.plot(center[0] + ring.real, center[1] + ring.imag, color=color, linewidth=1.0)
        for mask, color, size in (
            (~is_moving, GREY, 0.15),
            (is_moving & ~is_found, COLORS["missed"], 2.5),
            (is_moving & is_found, GREEN, 2.5),
        ):
            axis.scatter(*points[mask, :2].T, s=size, color=color, linewidths=0, zorder=3)


class Picture:
    """A square of ground without axes, written to docs/images when the block ends."""

    def __init__(self, name: str, center: np.ndarray, radius: float = RADIUS):
        self.path = IMAGES / f"{name}.png"
        self.figure = Figure(figsize=(8.0, 4.6), dpi=110)
        self.axis = self.figure.add_axes((0, 0, 1, 1))
        self.axis.set(xlim=(center[0] - radius, center[0] + radius), xticks=[], yticks=[])
        self.axis.set_ylim(center[1] - 0.575 * radius, center[1] + 0.575 * radius)
        self.axis.set_frame_on(False)

    def __enter__(self):
        return self.axis

    def __exit__(self, *error) -> None:
        FigureCanvasAgg(self.figure)
        self.figure.savefig(self.path, facecolor="white", pil_kwargs={"optimize": True})
        _fewer_colors(self.path)


# ------------------------------------------------------------------------------------------------- pages
def draw_report(run: Path, shot: Browser) -> None:
    """Take a picture of the report."""
    write_report(open_run(run), run / "report.html")
    shot.open((run / "report.html").as_uri(), 1.5)
    shot.take("report", 1280, 960)


def draw_review(run: Path, shot: Browser) -> None:
    """Take a picture of the review, at something large that moves."""
    session = Session(open_run(run))
    moving = [track for track in session.overview()["items"] if track.get("verdict") == "moving"]
    telling = max(moving, key=lambda track: track["seen"] * track["size"][0])["id"]
    server = ReviewServer(session)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    shot.open(server.url, 3.0)
    shot.page.execute_script("document.getElementById('over-back').click()")
    chips = "[...document.querySelectorAll('#filters button')]"
    shot.page.execute_script(f"{chips}.find((chip) => chip.textContent.startsWith('moving')).click()")
    shot.page.execute_script(f"document.querySelector('#queue [data-id=\"{telling}\"]').click()")
    time.sleep(3.0)
    shot.page.execute_script("document.getElementById('play').click()")
    shot.take("review", 1280, 800)
    server.shutdown()


def draw_viewer(run: Path, shot: Browser) -> None:
    """Take a picture of the viewer."""
    with Viewer(web=True) as viewer:
        viewer.send(open_run(run), 40_000)
        shot.open(viewer.url, 60.0)
        shot.take("viewer", 1280, 800)
        _fewer_colors(IMAGES / "viewer.png")


class Browser:
    """A headless browser that takes pictures."""

    def __init__(self):
        from selenium import webdriver

        options = webdriver.ChromeOptions()
        options.binary_location = shutil.which("chromium") or shutil.which("google-chrome")
        for argument in (
            "headless=new",
            "no-sandbox",
            "hide-scrollbars",
            "use-angle=swiftshader",
            "enable-unsafe-swiftshader",
        ):
            options.add_argument(f"--{argument}")
        self.page = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
        self._size(1280, 800)

    def open(self, address: str, seconds: float) -> None:
        """Open a page and give it time to draw."""
        self.page.get(address)
        time.sleep(seconds)

    def take(self, name: str, width: int, height: int) -> None:
        """Write what is seen to docs/images."""
        self._size(width, height)
        time.sleep(2.0)
        self.page.save_screenshot(str(IMAGES / f"{name}.png"))

    def _size(self, width: int, height: int) -> None:
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)


def _fewer_colors(path: Path) -> None:
    """Write a picture again with 256 colours: a third of the bytes, and nobody sees it."""
    from PIL import Image

    Image.open(path).convert("RGB").quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main()
