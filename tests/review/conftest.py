"""A review of a small run, served."""

import shutil
import threading

import pytest

from automos.results.open_run import open_run
from automos.review.server import ReviewServer
from automos.review.session import Session


@pytest.fixture
def server(lane_run, tmp_path):
    """Return a server that runs on a copy of a run."""
    yield from _served(lane_run, tmp_path)


@pytest.fixture(scope="module")
def unmoved(lane_run, tmp_path_factory):
    """Return a server for tests of what it refuses: one for all tests of a file."""
    yield from _served(lane_run, tmp_path_factory.mktemp("review"))


def _served(lane_run, folder):
    run = shutil.copytree(lane_run, folder / "run")
    server = ReviewServer(Session(open_run(run)))
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)  # seconds until it sees its end
    thread.start()
    yield server
    server.shutdown()
    server.server_close()
    thread.join()
