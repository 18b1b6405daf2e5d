"""Every number that shapes a result, with its unit, range and, where it comes from the paper, its section.

Lengths are metres, angles degrees, times seconds. `preset("paper")` is the seed paper to the letter; `preset("default")`
is whatever measures best. Order of precedence: preset < settings file < command line.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class _Group(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)


class OdometrySettings(_Group):
    """III-A: poses of every scan."""

    voxel: float | None = Field(None, gt=0, description="m, local map voxel; none: a hundredth of max_range")
    max_range: float = Field(100.0, gt=0, description="m, points used for registration")
    min_range: float = Field(1.0, ge=0, description="m, points used for registration")
    time: Literal["auto", "file", "azimuth", "none"] = Field(
        "auto",
        description="where the points' times come from for motion compensation: the file, the azimuth, or none (already "
        "compensated); auto takes the file's, else finds out which of the others folds the scans best",
    )
    loop_closure: bool = Field(False, description="recognise revisited places and close the loop (bends poses locally)")
    threads: int = Field(0, ge=0, description="0: all cores")


class ErasorSettings(_Group):
    """III-B: ERASOR (Lim et al., RA-L 2021). Defaults: the whole-sequence preset of its authors (large_scale)."""

    version: Literal[2, 3] = Field(3, description="2: the paper's decision; 3: the released one")
    max_range: float = Field(80.0, gt=0, description="m, radius of the volume of interest")
    rings: int = Field(20, gt=0)
    sectors: int = Field(108, gt=0)
    min_height: float = Field(-0.8, description="m above the ground under the sensor")
    max_height: float = Field(3.1, description="m above the ground under the sensor")
    scan_ratio: float = Field(0.2, gt=0, lt=1, description="pseudo occupancy ratio below which a bin has changed")
    min_points: int = Field(6, ge=1, description="scan points a bin needs to be compared")
    bin_max_height: float = Field(0.2, description="m, version 2: a removed bin must reach higher than this")
    ground_seed_height: float = Field(0.5, gt=0, description="m above the lowest points: seeds of the plane")
    ground_lowest_skipped: int = Field(5, ge=0, description="lowest points skipped as outliers")
    ground_lowest: int = Field(15, gt=0, description="lowest points whose mean starts the plane")
    ground_iterations: int = Field(3, ge=1)
    ground_distance: float = Field(0.125, gt=0, description="m, points nearer the plane (or below it) are ground")
    voxel: float = Field(0.2, gt=0, description="m, map and scan voxel")
    every: int = Field(1, ge=1, description="every how many scans the map is compared with")
    ego_radius: float = Field(2.7, ge=0, description="m, points nearer than this are the vehicle itself")
    submap_scans: int = Field(200, ge=2, description="scans in one submap, at most")
    submap_length: float = Field(160.0, gt=0, description="m driven in one submap, at most")
