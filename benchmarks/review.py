"""How long a person waits for the review: until it opens, an object is drawn, a decision is in the log, all is written.

    python benchmarks/review.py RUN [--label RECORDING] [--objects 2000] [--decisions 100] [--json FILE]

RUN is the results folder of `automos label`, with its recording where it was; --label makes it first where that was not
done. It is copied, and its objects are taken again under other numbers until there are as many as asked for. Requests
are the page's own, over HTTP; each decision is on the next object of the queue. Seconds are those of the wall: the
middle, and that which 95 of 100 stay below.
"""

from __future__ import annotations

import argparse
import http.client
import json
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from automos import load_settings, open_sequence
from automos.labeling import label_recording
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdicts
from automos.results.open_run import open_run
from automos.review.run_stages import RunStages
from automos.review.server import ReviewServer
from automos.review.session import Session


def multiply(folder: Path, n_objects: int) -> None:
    """Take the objects of a run again under other numbers until there are `n_objects`."""
    stages = RunStages(folder, open_run(folder).sequence)
    tracks, verdicts = stages.tracks, stages.verdicts
    times = -(-n_objects // len(tracks))
    many = Tracks.concatenate([replace(tracks, track=tracks.track + k * len(tracks)) for k in range(times)])
    judged = Verdicts(np.tile(verdicts.verdict, times), np.tile(verdicts.confidence, times))
    wanted = many[np.flatnonzero(many.track < n_objects)]
    first = Verdicts(judged.verdict[:n_objects], judged.confidence[:n_objects])
    stages.stage("tracking").save("all", {**wanted.to_arrays(), **first.to_arrays()})


class Page:
    """What the page asks and says."""

    def __init__(self, server: ReviewServer):
        self._server = server
        self._connection = http.client.HTTPConnection("127.0.0.1", server.server_port)

    def ask(self, path: str, body: Any = None) -> Any:
        """Return the answer to a request."""
        content = None if body is None else json.dumps(body)
        headers = {"Content-Type": "application/json", "Cookie": self._server.cookie}
        self._connection.request("GET" if body is None else "POST", path, content, headers)
        answer = self._connection.getresponse()
        told = json.loads(answer.read())
        assert answer.status == 200, told
        return told


def seconds_of(does: Callable[[], Any]) -> tuple[float, Any]:
    """Return how long a call takes, and what it gives."""
    began = time.perf_counter()
    given = does()
    return time.perf_counter() - began, given


def measure(folder: Path, n_decisions: int) -> dict[str, list[float]]:
    """Return the seconds of each kind of waiting."""
    opened, session = seconds_of(lambda: Session(open_run(folder)))
    server = ReviewServer(session)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    page = Page(server)
    listed, overview = seconds_of(lambda: page.ask("/api/overview"))
    ids = [item["id"] for item in overview["items"] if "id" in item][:n_decisions]
    drawn, decided = [], []
    for k, track in enumerate(ids):
        drawn.append(seconds_of(lambda track=track: page.ask(f"/api/scene?track={track}"))[0])
        said = {"tracks": [track], "verdict": ("moving", "static", "unknown")[k % 3]}
        decided.append(seconds_of(lambda said=said: page.ask("/api/decide", said))[0])
    finished = seconds_of(lambda: page.ask("/api/finish", {}))[0]
    server.shutdown()
    server.server_close()
    return {
        f"the review opens, {len(session.stages.tracks):,} objects": [opened],
        "the list": [listed],
        "an object is drawn": drawn,
        "a decision is in the log": decided,
        f"Finish after {len(ids)} decisions": [finished],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--label", type=Path, help="the recording of the run")
    parser.add_argument("--objects", type=int, default=2000)
    parser.add_argument("--decisions", type=int, default=100)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    if given.label:
        label_recording(open_sequence(given.label), given.run, load_settings("default"))
    with tempfile.TemporaryDirectory() as work:
        folder = Path(shutil.copytree(given.run, Path(work) / "run"))
        multiply(folder, given.objects)
        found = measure(folder, given.decisions)
    print("| | middle | 95 of 100 |\n|---|---:|---:|")
    for what, seconds in found.items():
        print(f"| {what} | {np.median(seconds):.3f} s | {np.percentile(seconds, 95):.3f} s |")
    print(f"\n{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
