"""A review of a long run starts at once: what there is to decide on is known without reading any scan."""

from automos.core import workspace
from automos.results.open_run import open_run
from automos.review.ahead import Pictures
from automos.review.session import Session
from automos.review.writer import Gain


def test_a_review_starts_without_reading_scan_after_scan(lane_run, monkeypatch):
    for beside, work in ((Pictures, "_make"), (Gain, "count")):
        monkeypatch.setattr(beside, work, lambda self: None)  # what goes on in the background
    read = []
    load = workspace._FolderStage.load
    monkeypatch.setattr(workspace._FolderStage, "load", lambda *given: read.append(given[1]) or load(*given))
    session = Session(open_run(lane_run))
    try:
        assert session.overview()["items"]
    finally:
        session.close()
    assert set(read) <= {"all", "concerns"}
