"""III-B: which points may be dynamic: the ground, the ego body, free-space evidence, and a network's cue."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class GroundSettings(Group):
    """The ground of one scan: walked outwards from the sensor, then a height map."""

    cell: float = Field(0.5, gt=0, description="m, side of a cell of the height map, and depth of a sector's cell")
    max_range: float = Field(80.0, gt=0, description="m, how far ground is looked for")
    tolerance: float = Field(0.08, gt=0, description="m, points at most this far above the surface are ground")
    tolerance_per_metre: float = Field(0.0015, ge=0, description="m more for each metre of distance from the sensor")


class EgoBodySettings(Group):
    """The ego body: points that keep their range in the sensor's frame while the sensor moves."""

    max_range: float = Field(10.0, gt=0, description="m, how far the body may reach from the sensor")
    near_reach: float = Field(1.2, gt=0, description="m, points that return from nearer again and again are ego body")
    min_share: float = Field(0.7, gt=0, le=1, description="share of those scans that must return the same range")
    tolerance: float = Field(0.06, gt=0, description="m, ranges nearer to each other than this are the same")


class ErasorSettings(Group):
    """III-B: ERASOR (Lim et al., RA-L 2021). Defaults: the whole-sequence preset of its authors (large_scale_05)."""

    version: Literal[2, 3] = Field(3, description="2: the paper's decision; 3: the released one, which removes less")
    max_range: float = Field(
        80.0, gt=0, description="m, radius of what is compared; a wider one finds what is further, in larger bins"
    )
    min_height: float = Field(
        -1.3, description="m above the ground under the sensor; a higher one leaves out more of what lies low"
    )
    max_height: float = Field(
        3.0,
        description="m above the ground under the sensor; a higher one takes in tall lorries, and trees above cars",
    )
    scan_ratio: float = Field(
        0.2, gt=0, lt=1, description="of heights below which a bin has changed; a higher one removes more"
    )
    voxel: float = Field(
        0.2,
        gt=0,
        description="m, of map and scan; a larger one needs less memory and takes more with a mover",
    )
    every: int = Field(
        4, ge=1, description="every how many scans the map is compared with; more takes less time and removes less"
    )


class FreeSpaceSettings(Group):
    """Free-space evidence: which places were observed empty before or after."""

    spans: tuple[float, ...] = Field(
        (0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0, 4.0, 5.5, 8.0),
        min_length=1,
        description="s, how long before and after a scan others are asked",
    )
    far_from: float = Field(2.5, gt=0, description="s, over longer spans only scans far_step apart are asked")
    far_step: float = Field(0.4, gt=0, description="s, between the scans that are asked over long spans")
    margin: float = Field(0.2, gt=0, description="m behind a point to which rays must go on to see free space")
    margin_per_metre: float = Field(0.005, ge=0, description="added to it per metre of range")
    hit: float = Field(0.25, gt=0, description="m, how near to a point a ray must end to have hit it again")
    hit_per_metre: float = Field(0.005, ge=0, description="added to it per metre of range")
    clear_width: float = Field(0.2, gt=0, description="m, width of a place that must be free")
    near_miss: float = Field(0.25, gt=0, description="m, free space counts in full if a row of rays came so near")
    weak_weight: float = Field(0.5, ge=0, le=1, description="of free space seen by the nearest rays only")
    lone_weight: float = Field(0.25, ge=0, le=1, description="of free space at a point that no neighbouring ray met")
    stay_weight: float = Field(0.25, ge=0, description="of a hit while the thing was there; 1 more while it was away")


class CandidatesSettings(Group):
    """III-B: which points may be dynamic."""

    method: Literal[
        "free_space", "erasor", "octomap", "removert", "yoon", "pfreundschuh", "dufomap", "m_detector", "hmm_mos"
    ] = "free_space"
    ground: GroundSettings = GroundSettings()
    ego_body: EgoBodySettings = EgoBodySettings()
    erasor: ErasorSettings = ErasorSettings()
    free_space: FreeSpaceSettings = FreeSpaceSettings()


class SelfTrainingSettings(Group):
    """What a network says of each point, as a further cue for the labeler."""

    folder: str = Field("", description="probabilities/ of automos segment --probabilities; empty: no cue")
    weight: float = Field(
        0.5, ge=0, description="of the network's log-odds; a larger one lets it outvote what the rays have seen"
    )
