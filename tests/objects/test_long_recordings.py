"""Memory of tracking: little for each segment that was ever seen, as recordings are long."""

from dataclasses import dataclass

import numpy as np
from forks import peak_memory

from automos.core.stages import Stage
from automos.core.upright_boxes import Boxes
from automos.objects.bodies import links_in_time
from automos.objects.detections import Detections
from automos.objects.tracking import Scans, follow_and_judge
from automos.objects.tracks import Tracks
from automos.settings import Settings

LIFE, N_SEGMENTS = 10, 200
"""Scans in which a thing is seen, and things in a scan."""


class Street(Stage):
    """Segments of things that stand beside a street, each of which is seen in a few scans."""

    def load(self, name: str, *keys: str) -> dict[str, np.ndarray]:
        """Return the segments of a scan."""
        things = int(name) * N_SEGMENTS // LIFE + np.arange(N_SEGMENTS)
        center = np.stack([5.0 * (things // 10), 10.0 * (things % 10), np.ones(N_SEGMENTS)], axis=1)
        many = np.full(N_SEGMENTS, 50.0)
        boxes = Boxes(center, np.ones((N_SEGMENTS, 3)), np.zeros(N_SEGMENTS), np.ones(N_SEGMENTS))
        found = Detections.of_objects(boxes, many, 0.0 * many, many).to_arrays()
        return {key: found[key] for key in keys} | {"has_stayed": np.ones(N_SEGMENTS, np.bool_)}


@dataclass
class Drive:
    """Frames of which nothing but the times is asked."""

    stamps: np.ndarray


def peak(n: int) -> int:
    """Return the bytes held at once to track `n` scans."""
    stage, names = Street(), [str(i) for i in range(n)]
    scans = Scans(Drive(0.1 * np.arange(n)), names, stage, stage)
    follow_and_judge(scans, Settings(), 1)  # compiles
    return peak_memory(lambda: follow_and_judge(scans, Settings(), 1))


def test_tracking_holds_a_row_a_few_numbers_and_no_copies_for_each_segment():
    per_segment = (peak(80) - peak(40)) / (40 * N_SEGMENTS)
    # A row of `Tracks` is 13 numbers, and is there twice while some are left out; the rest is its evidence and outline.
    assert per_segment < 8 * (2 * 13 + 24)


def test_links_are_sought_among_those_of_a_time():
    n, at_once = 2000, 40
    k = np.arange(n)
    center = np.stack([5.0 * (k % at_once), 0.0 * k, 0.0 * k], axis=1)
    tracks = Tracks(k, k // at_once, 0 * k, center, np.ones((n, 3)), np.zeros(n), 0.0 * center)
    every, times = np.ones(n, np.bool_), 0.1 * np.arange(n // at_once)
    links_in_time(tracks, every, every, np.zeros(n), times)
    held = peak_memory(lambda: links_in_time(tracks, every, every, np.zeros(n), times))
    assert held < 40 * 8 * at_once * n  # pairs of those of one scan with all others; all pairs of 5 s are many more
