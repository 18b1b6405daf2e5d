"""Settings of the output: labels, additional files, the map."""

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class LabelsSettings(Group):
    """The meaning of the labels."""

    moving: Literal["sequence", "now"] | None = Field(
        None,
        description="moves at any time of the recording, or in this scan; by default the first, and the second "
        "while more scans come, as nobody knows yet what will move",
    )
    unsure: float = Field(0.0, ge=0, le=1, description="confidence below which a point is unlabeled; more labels less")


class OutputSettings(Group):
    """Files written per point."""

    confidence: bool = Field(False, description="write confidences/: the confidence of each point's label")
    track_ids: bool = Field(False, description="write the track's number to the upper 16 bits of moving points")


class LoopSettings(Group):
    """Loop closure: when a place counts as revisited."""

    reach: float = Field(40.0, gt=0, description="m around a place; more distinguishes places better and takes longer")
    min_distance: float = Field(50.0, gt=0, description="m driven before a revisit; larger values find fewer loops")
    max_drift: float = Field(0.05, ge=0, description="drift per distance driven; more searches farther for loops")
    min_overlap: float = Field(0.7, gt=0, le=1, description="matching part of non-ground points; more rejects loops")


class MapSettings(Group):
    """The map without moving objects (paper Fig. 5)."""

    voxel: float = Field(
        0.1,
        gt=0,
        description="m, side of a voxel, which becomes one mean point of the map; larger voxels are coarser",
    )
    max_range: float = Field(60.0, gt=0, description="m, range of points used; more reaches farther and blurs more")
    loop_closure: bool = Field(False, description="bend the path so that places seen again coincide; takes longer")
    loops: LoopSettings = Field(default_factory=LoopSettings)
