"""Fixtures every test may use."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from worlds import lane, write_bins

# The same examples on every run: a failure seen once is seen again. The first call of a kernel may compile it.
settings.register_profile("automos", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("automos")

# A suite that a shell started in the background ignores Ctrl-C, as would the commands it tests: they inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

_NAMES = ("kitti_0005", "kitti_0027")
_OTHERS = ("lyft_5hz", "room_vlp16", "yard_avia", "handheld_xt32")


@pytest.fixture(autouse=True)
def environment_as_before() -> Iterator[None]:
    """Take back what a command sets in the environment for the processes it starts: here other tests would have it."""
    before = dict(os.environ)
    yield
    for name in set(os.environ) - set(before):
        del os.environ[name]
    os.environ.update(before)


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Return a folder that holds sequences/kitti_0005 and sequences/kitti_0027, real drives in KITTI's layout.

    Others that may be there are given by `recording_of`.

    The environment variable AUTOMOS_RECORDINGS names it. Without it, packed recordings in a folder `shared/data` beside
    the repository are unpacked once into the system's temporary folder. Without either, the test is skipped.
    """
    named = os.environ.get("AUTOMOS_RECORDINGS")
    packed = Path(__file__).resolve().parents[2] / "shared" / "data"
    if named:
        root = Path(named)
    elif (packed / "unpack.py").exists() and any(packed.glob("*/*.tar")):
        root = _unpack_once(packed)
    else:
        pytest.skip("real recordings are not here: set AUTOMOS_RECORDINGS to a folder that holds sequences/")
    missing = [name for name in _NAMES if not (root / "sequences" / name).is_dir()]
    if missing:
        pytest.skip(f"{root / 'sequences'} holds no {', '.join(missing)}")
    return root


@pytest.fixture
def recording_of(recordings) -> Callable[[str], Path]:
    """Return a function that gives the folder of a real recording by its name; it skips where that is not there."""

    def find(name: str) -> Path:
        folder = recordings / "sequences" / name
        if not folder.is_dir():
            pytest.skip(f"{folder.parent} holds no {name}")
        return folder

    return find


def _unpack_once(packed: Path) -> Path:
    """Unpack behind a file lock, so that parallel workers and later sessions share one copy."""
    fcntl = pytest.importorskip("fcntl", reason="recordings are unpacked under a lock that this system has not")
    root = Path(tempfile.gettempdir()) / f"automos-recordings-{os.getuid()}"
    root.mkdir(exist_ok=True)
    with open(root / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = root / "all-unpacked"
        if not done.exists():
            subprocess.run(
                [sys.executable, packed / "unpack.py", root, *_NAMES, *_OTHERS], check=True, stdout=subprocess.DEVNULL
            )
            done.touch()
    return root


@pytest.fixture(scope="session")
def lane_run(tmp_path_factory) -> Path:
    """Return a results folder of a small world, labelled by one command; the recording has truth. Copy to change it."""
    from automos.labeling import label_recording
    from automos.readers import open_sequence
    from automos.settings import load_settings

    folder = tmp_path_factory.mktemp("lane")
    world, recording = lane(), folder / "lane"
    write_bins(world.sequence, recording / "velodyne")
    (recording / "labels").mkdir()
    for name, truth in zip(world.sequence.names, world.truth, strict=True):
        truth.astype("u4").tofile(recording / "labels" / f"{name}.label")
    (recording / "times.txt").write_text("".join(f"{stamp:.9f}\n" for stamp in world.sequence.stamps))
    label_recording(open_sequence(recording), folder / "run", load_settings("default"), workers=1)
    return folder / "run"


@pytest.fixture(scope="session")
def chromium():
    """Return a headless browser; skip with a reason where there is none."""
    selenium = pytest.importorskip("selenium.webdriver", reason="selenium is not installed: pip install selenium")
    from selenium.common.exceptions import TimeoutException, WebDriverException

    class Chrome(selenium.Chrome):
        def get(self, url):
            """Open a page; on a busy machine the browser sometimes waits for itself, and is asked a second time."""
            try:
                super().get(url)
            except TimeoutException:
                super().get(url)

    driver = shutil.which("chromedriver")
    binary = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if driver is None or binary is None:
        pytest.skip("no browser: install chromium and chromium-driver")
    options = selenium.ChromeOptions()
    options.binary_location = binary
    for argument in ("headless=new", "no-sandbox", "disable-dev-shm-usage", "window-size=1280,900"):
        options.add_argument(f"--{argument}")
    for argument in ("use-angle=swiftshader", "enable-unsafe-swiftshader"):  # WebGL without a graphics card
        options.add_argument(f"--{argument}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    try:
        opened = Chrome(options=options, service=selenium.ChromeService(driver))
    except WebDriverException as error:
        pytest.skip(f"the browser does not start: {error.msg}")
    opened.set_script_timeout(20)
    opened.set_page_load_timeout(45)  # less than the driver's own patience of two minutes, which ends the test
    yield opened
    opened.quit()


@pytest.fixture
def browser(chromium):
    """Return a headless browser whose page says nothing on its console: neither errors nor warnings of the page."""
    chromium.get("about:blank")
    chromium.get_log("browser")
    yield chromium
    said = [entry["message"] for entry in chromium.get_log("browser") if entry["level"] == "SEVERE"]
    chromium.get("about:blank")  # a page that draws would go on beside the tests that follow
    assert said == []
