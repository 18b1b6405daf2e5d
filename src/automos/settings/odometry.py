"""III-A: poses of every scan, refinement over longer baselines, loop closure."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class LoopSettings(Group):
    """Loop closure: when a place counts as seen before."""

    reach: float = Field(40.0, gt=0, description="m around a place; more distinguishes places better, and takes longer")
    min_distance: float = Field(50.0, gt=0, description="m driven before a place can be seen again")
    max_drift: float = Field(0.05, ge=0, description="of the distance driven, by which poses may be off")
    min_overlap: float = Field(0.7, gt=0, le=1, description="share of what stands on the ground that must lie close")


class OdometrySettings(Group):
    """III-A: poses of every scan."""

    voxel: float | None = Field(None, gt=0, description="m, local map voxel; none: a hundredth of max_range")
    max_range: float = Field(100.0, gt=0, le=20_000, description="m, points used for registration")
    min_range: float = Field(1.0, ge=0, description="m, points used for registration")
    points_per_voxel: int = Field(
        20, ge=1, le=10_000, description="points kept in a voxel of the local map; fewer are faster"
    )
    time: Literal["auto", "file", "order", "azimuth", "none"] = Field(
        "auto",
        description="where the points' times come from for motion compensation: the file, the order of the points, "
        "their azimuth, or none (already compensated); auto finds out under which of them the scans fit together best",
    )
    refine: bool = Field(True, description="align scans with submaps seconds away, too")
    usual_acceleration: float = Field(
        3.0, ge=0.001, description="m/s^2, usual change of speed; more smooths poses less"
    )
    usual_turn_acceleration_deg: float = Field(60.0, ge=0.01, description="deg/s^2, usual change of turn rate")
    max_speed: float = Field(
        45.0, gt=0, le=1000, description="m/s, speeds tried where registration may follow the traffic"
    )
    max_reverse: float = Field(10.0, ge=0, le=1000, description="m/s, the same backwards")
    overhead: float = Field(2.7, description="m above the sensor along its z axis, where no vehicle reaches")
    max_wall_thickness: float = Field(0.08, gt=0, description="m over one second, thicker walls are warned of")
    max_disagreement: float = Field(
        0.1, gt=0, description="m between short and second-long baselines, more is warned of"
    )
    max_tilt_deg: float = Field(45.0, gt=0, le=90, description="deg between the sensor's z axis and the vertical")
    min_height: float = Field(0.1, ge=0, description="m, sensor over ground")
    max_height: float = Field(5.0, gt=0, description="m, sensor over ground")
    loop_closure: bool = Field(
        False, description="take out the drift that revisits show; poses bend a little, which costs labels"
    )
    loops: LoopSettings = Field(default_factory=LoopSettings)
