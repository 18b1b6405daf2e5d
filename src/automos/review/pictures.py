"""Pictures for the list, made behind the scenes: one walk through the scans for all of them."""

from __future__ import annotations

import threading
from typing import Any

from automos.errors import AutomosError
from automos.geometry import transform
from automos.results.run_files import RunFiles
from automos.review.apply import Changes
from automos.review.queue import Queue
from automos.visualization.thumbnails import Thumbnails

MOST = 400
"""Objects that get a picture, those first in the queue; who goes on that far sees the others when they are open."""


class Pictures:
    """Thumbnails by track id, there as soon as all scans were gone through."""

    def __init__(self, run: RunFiles, queue: Queue):
        """Begin to make them."""
        self._run, self._queue = run, queue
        self._found: dict[int, dict[str, Any]] | None = None
        self._is_stopped = False
        threading.Thread(target=self._make, daemon=True).start()

    def to_page(self) -> dict[str, Any]:
        """Return the pictures by track id, or that they are not ready."""
        return {"ready": self._found is not None, "pictures": self._found or {}}

    def stop(self) -> None:
        """Make no more."""
        self._is_stopped = True

    def _make(self) -> None:
        try:
            wanted = [item["id"] for item in self._queue.to_page(Changes())["items"] if "id" in item][:MOST]
            tracks = {track["id"]: track for track in self._run.tracks_file["tracks"]}
            thumbnails = Thumbnails([tracks[track] for track in wanted if track in tracks])
            for index in sorted(thumbnails.scans):
                if self._is_stopped:
                    return
                scan = self._run.scan(index)
                points = transform(self._run.T_level_sensor(index), self._run.points_at_pose(scan, index))
                thumbnails.add(index, points[scan.is_valid])
            self._found = thumbnails.to_page()
        except AutomosError:
            self._found = {}  # a list without pictures is a list
