"""Recordings so small that thirty are labelled in seconds, their labels, and a store that behaves like S3."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest
from worlds import Block, drive, record, rider, write_bins

from automos.labeling import label_recording
from automos.readers import open_sequence
from automos.settings import Settings, load_settings

N_SCANS = 12


@dataclass(frozen=True)
class Fleet:
    """A folder of recordings, the settings they are labelled with, and all result files that must be the same."""

    folder: Path
    settings: Settings
    expected: dict[str, dict[str, bytes]]

    @property
    def names(self) -> list[str]:
        return list(self.expected)

    def differences(self, results: Path) -> list[str]:
        """Return names of recordings whose results in folder `results` are not those of a plain run, byte for byte."""
        return [name for name in self.names if result_files(results / name) != self.expected[name]]


def result_files(folder: Path) -> dict[str, bytes]:
    """Return what a run leaves, but for what tells of time and place."""
    labels = [*folder.glob("predictions/*"), *folder.glob("confidences/*")]
    kept = [*labels, *(folder / name for name in ("poses.txt", "poses.tum", "tracks.json"))]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in kept if path.exists()}


def write_recording(folder: Path, seed: int, n_scans: int = N_SCANS) -> Path:
    """Write a lane with two cyclists; each seed another."""
    walls = (Block((0.0, 12.0, 3.0), (60.0, 2.0, 6.0)), Block((0.0, -12.0, 3.0), (60.0, 2.0, 6.0)))
    riders = (rider(-3.0 + 0.2 * seed, 5.0, speed=5.0), rider(6.0, -3.0, yaw=1.6, speed=4.0 + 0.1 * seed))
    world = record((*walls, *riders), drive(n_scans), n_beams=10, seed=seed)
    return write_bins(world.sequence, folder)


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
    """Return three recordings."""
    return make_fleet(3)


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
