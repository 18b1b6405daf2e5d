"""Landmarks: surfaces and isolated points that cannot be traffic, and how many of them are re-observed at a speed."""

from typing import NamedTuple, Self

import numpy as np

from automos.core.geometry import Array
from automos.core.scan import Mask
from automos.odometry.facing import SAME_SPEED

CLEARLY_MORE = 1.2
"""Standard deviations of the evidence by which a speed must lead another."""


class Landmarks(NamedTuple):
    """Re-observed landmarks at M places: surfaces and isolated points that cannot be traffic, far aside or overhead."""

    speeds: Array  # (M,) m/s
    refound: Array  # (M,) evidence re-observed at these speeds
    expected: Array  # (M,) the least evidence expected at these speeds

    @classmethod
    def nothing(cls) -> Self:
        """Return the landmarks without any places."""
        return cls(*np.zeros((3, 0)))

    @classmethod
    def concatenate(cls, parts: list[Self]) -> Self:
        """Return the landmarks of several windows, at least one."""
        return cls(*map(np.concatenate, zip(*parts, strict=True)))

    def explains_more_than(self, other: Self) -> bool:
        """Whether these speeds have clearly more evidence than the others."""
        return self.lead_over(other) > CLEARLY_MORE

    @property
    def are_missed(self) -> bool:
        """Whether clearly less is re-observed than expected: a stationary sensor re-observes roadside landmarks."""
        missed = self.expected.sum() - self.refound.sum()
        return bool(missed > CLEARLY_MORE * np.sqrt(self.expected.sum()))

    def lead_over(self, other: Self) -> float:
        """Return the lead in evidence where speeds differ, in standard deviations of the counts (Anscombe)."""
        differ = np.abs(self.speeds - other.speeds) > SAME_SPEED
        here, there = np.sqrt(np.array([self._evidence(differ), other._evidence(differ)]) + 3.0 / 8.0)
        return float(np.sqrt(2.0) * (here - there))

    def _evidence(self, places: Mask) -> float:
        """Return the re-observed evidence at `places`, minus the part of the expected evidence that is missing."""
        refound, expected = self.refound[places].sum(), self.expected[places].sum()
        return float(max(refound - max(expected - refound, 0.0), 0.0))


def is_ahead(rival: Landmarks, present: Landmarks, is_possible: bool) -> bool:
    """Whether landmarks favour the rival: clearly, or at all if no vehicle can follow the present poses."""
    return rival.explains_more_than(present) or (not is_possible and rival.lead_over(present) > 0.0)
