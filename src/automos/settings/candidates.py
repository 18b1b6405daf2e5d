"""III-B: which points may be dynamic: the ground, the vehicle's own body, the evidence, what a network adds to it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class GroundSettings(Group):
    """The ground of one scan: walked outwards from the sensor, then a height map."""

    cell: float = Field(0.5, gt=0, description="m, side of a cell of the height map, and depth of a sector's cell")
    max_range: float = Field(80.0, gt=0, description="m, how far ground is looked for")
    sectors: int = Field(360, ge=8, description="sectors around the sensor")
    start_range: float = Field(10.0, gt=0, description="m, the ground's height is first taken from within this")
    step: float = Field(0.12, gt=0, description="m, ground may rise or fall by this at once (a kerb)")
    max_bend: float = Field(0.06, gt=0, description="m per m, how fast the ground's slope may change")
    max_step: float = Field(
        0.3, gt=0, description="m, most that ground may differ from what is expected, however far on"
    )
    max_slope: float = Field(0.35, gt=0, description="steepest ground, rise over run")
    ghost_depth: float = Field(0.15, gt=0, description="m, a sight this far under nearer ground is a mirror image")
    tolerance: float = Field(0.08, gt=0, description="m, points at most this far above the surface are ground")
    tolerance_per_metre: float = Field(0.0015, ge=0, description="m more for each metre of distance from the sensor")
    max_depth: float = Field(0.3, gt=0, description="m, points further below the surface than this are not ground")


class EgoBodySettings(Group):
    """The vehicle's own body: what keeps its range in the sensor's frame while the sensor moves."""

    max_range: float = Field(10.0, gt=0, description="m, how far the body may reach from the sensor")
    near_reach: float = Field(1.2, gt=0, description="m, what nearly always returns from nearer than this rides along")
    max_scans: int = Field(40, ge=2, description="scans looked at, spread over the recording")
    min_scans: int = Field(9, ge=3, description="with fewer scans apart from each other nothing is called body")
    min_distance: float = Field(0.5, gt=0, description="m, how far apart the sensor must be in scans looked at")
    min_share: float = Field(0.7, gt=0, le=1, description="share of those scans that must return the same range")
    min_overlap: float = Field(
        0.8, gt=0, le=1, description="share of a part at the ends of the recording that must be there at both"
    )
    tolerance: float = Field(0.06, gt=0, description="m, ranges nearer to each other than this are the same")
    max_drift: float = Field(
        0.025, gt=0, description="m, of a part's range from the first third of the recording to the last"
    )
    beyond: float = Field(0.5, gt=0, description="m beyond the body's reach from which what is seen shows the world")
    world_distance: float = Field(0.25, gt=0, description="m between a place and what is seen there from elsewhere")
    world_share: float = Field(0.05, gt=0, lt=1, description="share of hits among such looks that make it the world's")
    min_cells: int = Field(4, ge=1, description="neighbouring rays that a part of the body must be met by")
    attached_share: float = Field(
        0.15, gt=0, le=1, description="of what hangs together that must be body for all of it to be; 1: nothing hangs"
    )


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
    """Evidence of motion: which places were seen to be empty before or after."""

    spans: tuple[float, ...] = Field(
        (0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0, 4.0, 5.5, 8.0),
        min_length=1,
        description="s, how long before and after a scan others are asked",
    )
    span_tolerance: float = Field(0.25, gt=0, lt=1, description="of a span, how far off the asked scan may be")
    far_from: float = Field(2.5, gt=0, description="s, over longer spans only scans far_step apart are asked")
    far_step: float = Field(0.4, gt=0, description="s, between the scans that are asked over long spans")
    first_spans: tuple[float, ...] = Field(
        (0.6, 1.7, 4.0, 8.0), min_length=1, description="s, asked first; what they agree to have hit has stayed"
    )
    sure_hits: int = Field(2, ge=1, description="hits without a see-through after which no more scans are asked")
    margin: float = Field(0.2, gt=0, description="m, how far behind a point rays must go on to have seen through it")
    margin_per_metre: float = Field(0.005, ge=0, description="added to it per metre of range")
    hit: float = Field(0.25, gt=0, description="m, how near to a point a ray must end to have hit it again")
    hit_per_metre: float = Field(0.005, ge=0, description="added to it per metre of range")
    clear_width: float = Field(0.2, gt=0, description="m, how wide the place must be free to be seen through")
    near_miss: float = Field(0.25, gt=0, description="m, a see-through counts in full if a row of rays came so near")
    weak_weight: float = Field(0.5, ge=0, le=1, description="of a see-through by the nearest rays only")
    lone_weight: float = Field(0.25, ge=0, le=1, description="of a see-through of what no neighbouring ray has met")
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
