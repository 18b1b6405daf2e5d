"""III-B: which points may be dynamic: the ground, the ego body, free-space evidence, and a network's cue."""

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class GroundSettings(Group):
    """The ground of one scan: followed outwards from the sensor, then a height map."""

    cell: float = Field(0.5, gt=0, description="m, side of a cell of the height map; larger cells are coarser")
    max_range: float = Field(80.0, gt=0, description="m, range of the ground; larger values find ground farther away")
    tolerance: float = Field(0.08, gt=0, description="m, height below which points are ground; more adds low objects")
    tolerance_per_metre: float = Field(0.0015, ge=0, description="m, increase of the tolerance per metre of range")


class EgoBodySettings(Group):
    """The ego body: points that keep their range in the sensor's frame while the sensor moves."""

    max_range: float = Field(10.0, gt=0, description="m, greatest range of the body; larger values allow larger bodies")
    near_reach: float = Field(1.2, gt=0, description="m, range of repeated returns from ego body; more finds more body")
    min_share: float = Field(0.7, gt=0, le=1, description="part of scans with equal range; more finds less body")
    tolerance: float = Field(0.06, gt=0, description="m, difference of equal ranges; more finds more body")


class FreeSpaceSettings(Group):
    """Free-space evidence: what was observed free before or after."""

    longest_span: float = Field(
        8.0, gt=0, description="s, between scans that are compared, at most; more finds what waits, and takes longer"
    )
    far_from: float = Field(2.5, gt=0, description="s, longer spans use only scans far_step apart; more needs memory")
    far_step: float = Field(0.4, gt=0, description="s, between scans for long spans; larger values use less memory")
    hit: float = Field(
        0.25,
        gt=0,
        description="m from a point within which a ray hits it again, and does not go on; more finds more hits",
    )
    hit_per_metre: float = Field(0.005, ge=0, description="m, increase of that distance per metre of range")
    clear_width: float = Field(0.2, gt=0, description="m, width that must be free; larger values find less free space")
    lone_weight: float = Field(0.25, ge=0, le=1, description="of free space at single points; more adds movers")
    stay_weight: float = Field(0.25, ge=0, description="of a hit (plus 1 while the object was away); more drops movers")


class CandidatesSettings(Group):
    """III-B: which points may be dynamic."""

    method: Literal[
        "free_space", "erasor", "octomap", "removert", "yoon", "pfreundschuh", "dufomap", "m_detector", "hmm_mos"
    ] = "free_space"
    ground: GroundSettings = GroundSettings()
    ego_body: EgoBodySettings = EgoBodySettings()
    free_space: FreeSpaceSettings = FreeSpaceSettings()
