"""III-C: the segments of one scan."""

from itertools import pairwise
from typing import Literal

from pydantic import Field, field_validator

from automos.settings.group import Group


class SegmentSettings(Group):
    """Segments of the whole non-ground scan."""

    cell: float = Field(0.25, gt=0, description="m, side of a cell in the ground plane; larger cells are coarser")
    max_range: float = Field(120.0, gt=0, description="m, half the side of the segmented area; more reaches farther")
    gap: float = Field(0.4, gt=0, description="m between segments; larger values join neighbours")
    gap_rays: float = Field(
        2.0, ge=0, description="spacings of rays: of columns, if more than the gap, of rows beside it; more joins more"
    )


class HdbscanSettings(Group):
    """III-C: class-agnostic segments by HDBSCAN, and the boxes kept."""

    epsilons: tuple[float, ...] = Field(
        (2.0, 1.0, 0.5, 0.25),
        min_length=1,
        description="m, gaps at which segments are split, decreasing (III-F); larger values join neighbours",
    )
    min_points: int = Field(5, ge=1, description="N_min (III-F); larger values drop more far or small objects")
    max_side: float = Field(
        20.0, gt=0, description="m, T_size (III-F); larger values keep lorries, and walls with movers beside them"
    )
    min_score: float = Field(
        0.5, ge=0, le=1, description="fraction of candidates in an instance; larger values find fewer instances"
    )

    @field_validator("epsilons")
    @classmethod
    def _check_epsilons(cls, epsilons: tuple[float, ...]) -> tuple[float, ...]:
        # Segments are nested and form a tree only if each eps is smaller than the one before.
        if not all(a > b for a, b in pairwise([*epsilons, 0.0])):
            raise ValueError("they must be greater than 0 and decrease")
        return epsilons


class DetectSettings(Group):
    """Segments of the whole scan, cut by the evidence of motion."""

    segments: SegmentSettings = SegmentSettings()
    min_log_odds: float = Field(  # 0.62 to 0.38: less than half a vote, and half votes are frequent
        0.49, ge=0, description="points above moved, below minus this are static; larger values leave more unknown"
    )
    min_points: int = Field(3, ge=1, description="points of the smallest object; larger values drop small objects")
    max_side: float = Field(45.0, gt=0, description="m, longest object; larger values keep walls")


class InstancesSettings(Group):
    """III-C: the segments of one scan."""

    method: Literal["components", "hdbscan"] = "components"
    max_range: float = Field(80.0, gt=0, description="m, range of instances; larger values find farther objects")
    hdbscan: HdbscanSettings = HdbscanSettings()
    components: DetectSettings = DetectSettings()
