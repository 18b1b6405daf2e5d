"""Small recordings with their labels, and a store that behaves like S3."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from small_fleet import N_SCANS, Fleet, result_files, write_recording

from automos.labeling import label_recording
from automos.readers import open_sequence
from automos.settings import load_settings


@pytest.fixture(scope="session")
def make_fleet(tmp_path_factory):
    """Return a function that makes a fleet of some recordings, labelled one by one."""
    made: dict[int, Fleet] = {}
    settings = load_settings("default")

    def make(n: int) -> Fleet:
        if n not in made:
            root = tmp_path_factory.mktemp(f"fleet{n}")
            expected = {}
            for k in range(n):
                log = write_recording(root / "logs" / f"log{k:02d}", seed=k)
                label_recording(open_sequence(log), root / "plain" / log.name, settings, workers=1)
                expected[log.name] = result_files(root / "plain" / log.name)
                assert len(expected[log.name]) == N_SCANS + 3
            made[n] = Fleet(root / "logs", settings, expected)
        return made[n]

    return make


@pytest.fixture
def fleet(make_fleet) -> Fleet:
    """Return two recordings."""
    return make_fleet(2)


class Server:
    """A store that speaks S3, in a process of its own, that can be stopped for a while."""

    def __init__(self, log: Path):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(self.port)],
            stdout=subprocess.DEVNULL,
            stderr=log.open("w"),
        )
        deadline = time.monotonic() + 60
        while not self._answers():
            assert self._process.poll() is None, log.read_text()
            assert time.monotonic() < deadline
            time.sleep(0.1)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def pause(self) -> None:
        """Accept connections and answer none."""
        self._process.send_signal(19)

    def go_on(self) -> None:
        self._process.send_signal(18)

    def end(self) -> None:
        self._process.kill()
        self._process.wait()

    def _answers(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0


@pytest.fixture(scope="session")
def _s3(tmp_path_factory) -> Iterator[SimpleNamespace]:
    for package in ("moto", "flask", "s3fs"):
        pytest.importorskip(package, reason=f"{package} is not installed: pip install '.[dev-scale]'")
    server = Server(tmp_path_factory.mktemp("s3") / "server.log")
    keys = {"AWS_ACCESS_KEY_ID": "a-key", "AWS_SECRET_ACCESS_KEY": "a-secret-that-nobody-may-see"}
    before = dict(os.environ)
    os.environ.update(keys | {"AWS_DEFAULT_REGION": "us-east-1", "AWS_ENDPOINT_URL": server.url})
    import s3fs

    yield SimpleNamespace(server=server, files=s3fs.S3FileSystem(use_listings_cache=False), secret="a-secret-that")
    server.end()
    os.environ.clear()
    os.environ.update(before)


@pytest.fixture
def s3(_s3):
    """Return a running S3 server (`server`) and its files (`files`), with an empty bucket named bucket."""
    if _s3.files.exists("bucket"):
        _s3.files.rm("bucket", recursive=True)
    _s3.files.mkdir("bucket")
    return _s3
