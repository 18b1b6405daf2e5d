"""III-A: poses of every scan, refinement over longer baselines."""

from typing import Literal

from pydantic import Field

from automos.settings.group import Group


class OdometrySettings(Group):
    """III-A: poses of every scan."""

    max_range: float = Field(100.0, gt=0, le=20_000, description="m, range of registered points; more adds far ones")
    min_range: float = Field(1.0, ge=0, description="m, least range of registered points; more leaves out near ones")
    time: Literal["auto", "file", "order", "azimuth", "none"] = Field(
        "auto",
        description="source of the points' times for motion compensation: the file, the order of the points, their "
        "azimuth, or none (already compensated); auto takes the one under which the scans fit together best",
    )
    usual_acceleration: float = Field(
        3.0, ge=0.001, description="m/s^2, usual change of speed; larger values smooth poses less"
    )
    usual_turn_acceleration_deg: float = Field(60.0, ge=0.01, description="deg/s^2, the same for the turn rate")
    max_speed: float = Field(
        45.0, gt=0, le=1000, description="m/s, top speed tried if registration may follow traffic; more takes longer"
    )
    max_reverse: float = Field(10.0, ge=0, le=1000, description="m/s, the same backwards")
    overhead: float = Field(2.7, description="m above the sensor along its z axis that no vehicle reaches")
    max_wall_thickness: float = Field(0.08, gt=0, description="m over one second before a warning; more warns less")
    max_disagreement: float = Field(
        0.1, gt=0, description="m between short and second-long baselines before a warning; more warns less"
    )
    max_tilt_deg: float = Field(45.0, gt=0, le=90, description="deg, greatest tilt of the sensor's z axis")
    min_height: float = Field(0.1, ge=0, description="m, least height of the sensor above the ground")
    max_height: float = Field(5.0, gt=0, description="m, greatest height of the sensor above the ground")
