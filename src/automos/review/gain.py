"""What a review is worth where there is truth: IoU of the labels as they were found, and as they are now."""

import threading
from typing import Any

from automos.core.errors import AutomosError
from automos.core.label_files import read_labels
from automos.evaluation.moving import Counts, count
from automos.review.run_stages import RunStages
from automos.review.waiting import Waiting


class Gain:
    """Counts of each scan before and after; a scan is counted again when its labels were written again."""

    def __init__(self, stages: RunStages, waiting: Waiting):
        """Begin to count, in a thread: `stages` are its own."""
        self._stages, self._waiting = stages, waiting
        self._found: dict[int, Counts] = {}
        self._now: dict[int, tuple[int, Counts]] = {}
        self._is_whole = False
        self._counting = threading.Lock()
        threading.Thread(target=self.count, daemon=True).start()

    def count(self) -> None:
        """Count all scans with truth that were not counted yet or were written since; without truth, none."""
        with self._counting:
            if self._is_whole and not self._found:
                return  # there is no truth
            try:
                for index, name in enumerate(self._stages.names):
                    self._waiting.give_way()
                    self._count_scan(index, name)
                self._is_whole = True
            except (AutomosError, OSError):
                self._is_whole = False  # a scan is being written, or gone: nothing is said of the whole

    def _count_scan(self, index: int, name: str) -> None:
        path = self._stages.folder / "predictions" / f"{name}.label"
        written = path.stat().st_mtime_ns
        if self._now.get(index, (None,))[0] == written:
            return
        truth = self._stages.frames.sequence.truth(index)
        if truth is None:
            return
        if index not in self._found:
            self._found[index] = count(self._stages.labels(index)["label"], truth)
        self._now[index] = written, count(read_labels(path, len(truth)), truth)

    def to_page(self) -> dict[str, Any] | None:
        """Return IoU `found` and `now`, in [0, 1]; None without truth, and until all scans are counted."""
        if not self._is_whole or not self._found:
            return None
        found = sum(self._found.values(), start=Counts()).scores
        now = sum((counts for _, counts in self._now.values()), start=Counts()).scores
        has_movers = found.true_dynamic + found.false_static > 0
        return {"found": found.iou, "now": now.iou} if has_movers else None
