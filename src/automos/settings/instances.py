"""III-C: what belongs together in one scan."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

from pydantic import Field, field_validator

from automos.settings.group import Group


class SegmentSettings(Group):
    """Segments of the whole non-ground scan."""

    cell: float = Field(0.25, gt=0, description="m, side of a cell seen from above")
    max_range: float = Field(120.0, gt=0, description="m, half the side of the area looked at")
    gap: float = Field(0.5, gt=0, description="m, things nearer to each other than this are one, seen from above")
    gap_columns: float = Field(
        2.5, ge=0, description="the same in distances between neighbouring rays, if that is more"
    )
    height_gap: float = Field(0.4, gt=0, description="m, likewise in height")
    height_gap_rows: float = Field(1.6, ge=0, description="added to it: distances between neighbouring rows of rays")


class HdbscanSettings(Group):
    """III-C: class-agnostic segments by HDBSCAN, and the boxes kept."""

    epsilons: tuple[float, ...] = Field(
        (2.0, 1.0, 0.5, 0.25),
        min_length=1,
        description="m, gaps at which segments are split, decreasing (III-F); larger ones join neighbours",
    )
    min_points: int = Field(5, ge=1, description="N_min (III-F); a larger one drops more of what is far or small")
    max_side: float = Field(
        20.0, gt=0, description="m, T_size (III-F); a larger one keeps lorries, and walls with movers beside them"
    )
    min_score: float = Field(
        0.5, ge=0, le=1, description="share of candidates that makes an instance; a larger one finds fewer"
    )

    @field_validator("epsilons")
    @classmethod
    def _check_epsilons(cls, epsilons: tuple[float, ...]) -> tuple[float, ...]:
        # Segments are nested, and their tree is one, only where each eps is smaller than the one before.
        if not all(a > b for a, b in pairwise([*epsilons, 0.0])):
            raise ValueError("they must be greater than 0 and decrease")
        return epsilons


class DetectSettings(Group):
    """Segments of the whole scan, cut by the evidence of motion."""

    segments: SegmentSettings = SegmentSettings()
    min_log_odds: float = Field(  # 0.62 to 0.38: less than half a vote, and half votes are frequent
        0.49, ge=0, description="of a point that has moved; below minus this it has stayed, between them it is unknown"
    )
    min_points: int = Field(3, ge=1, description="points of the smallest object")
    max_side: float = Field(45.0, gt=0, description="m, longest object")
    min_share: float = Field(0.5, ge=0, le=1, description="moved, of the points the evidence speaks of")


class InstancesSettings(Group):
    """III-C: what belongs together in one scan."""

    method: Literal["components", "hdbscan"] = "components"
    max_range: float = Field(80.0, gt=0, description="m, points further away are in no instance")
    hdbscan: HdbscanSettings = HdbscanSettings()
    components: DetectSettings = DetectSettings()
