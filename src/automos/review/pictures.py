"""Pictures of tracks for the list, made in the background: those in sight first, the others in one pass."""

import threading
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

from automos.core.errors import AutomosError
from automos.core.geometry import transform
from automos.results.run_files import RunFiles
from automos.results.tracks_file import track_entries
from automos.review.amendments import Amendment
from automos.review.apply import amended_entry
from automos.review.queue import Queue
from automos.review.run_stages import Changes, RunStages, number_of
from automos.review.waiting import Waiting
from automos.views.thumbnails import Thumbnails

MOST = 400
"""Objects that get a picture, those first in the queue; who goes on that far sees the others when they are open."""
IN_SIGHT = 12
"""Rows of the list on a usual screen: for their pictures nobody waits until a long recording was read through."""


class Pictures:
    """Thumbnails by object id: of what was found once its scans were gone through, of what is made by hand at once."""

    def __init__(self, run: RunFiles, stages: RunStages, queue: Queue, waiting: Waiting):
        """Begin to make them."""
        self._run, self._stages, self._queue, self._waiting = run, stages, queue, waiting
        self._found: dict[int, dict[str, Any]] = {}
        self._is_whole = False
        self._made: dict[int, dict[str, Any]] = {}
        self._is_stopped = False
        threading.Thread(target=self._make, daemon=True).start()

    def to_page(self, amendments: Iterable[Amendment]) -> dict[str, Any]:
        """Return the pictures by object id, those of objects made by hand too, and whether that is all."""
        for amendment in amendments:
            if number_of(self._stages, amendment) + 1 not in self._made:
                self._made |= self._picture(amended_entry(self._stages, amendment))
        return {"ready": self._is_whole, "pictures": self._found | self._made}

    def stop(self) -> None:
        """Make no more."""
        self._is_stopped = True

    def _picture(self, entry: dict[str, Any]) -> dict[int, dict[str, Any]]:
        thumbnails = Thumbnails([entry])
        for index in thumbnails.scans:
            thumbnails.add(index, self._stages.frame(index).points_level)
        return thumbnails.to_page()

    def _make(self) -> None:
        with suppress(AutomosError):  # a list without pictures is a list
            wanted = [item["id"] for item in self._queue.to_page(Changes())["items"] if "id" in item][:MOST]
            for ids in (wanted[:IN_SIGHT], wanted[IN_SIGHT:]):
                found = self._stages.tracks, self._stages.verdicts, self._stages.trajectory
                self._add(list(track_entries(*found, [track - 1 for track in ids])))
        self._is_whole = True

    def _add(self, entries: list[dict[str, Any]]) -> None:
        thumbnails = Thumbnails(entries)
        for index in sorted(thumbnails.scans):
            self._waiting.give_way()
            if self._is_stopped:
                return
            scan = self._run.scan(index)
            points = transform(self._run.T_level_sensor(index), self._run.points_at_pose(scan, index))
            thumbnails.add(index, points[scan.is_valid])
        self._found = self._found | thumbnails.to_page()
