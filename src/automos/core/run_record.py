"""The schema of run.json, checked when it is read."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field


class _Strict(BaseModel):
    model_config = ConfigDict(strict=True)


class _Recording(_Strict):
    name: str = ""
    scans: int = 0
    source: str | None = None
    warnings: list[str] = []


class _Notes(_Strict):
    warnings: list[str] = []
    lost: list[str] = []


class _Warning(_Strict):
    kind: str = ""
    sentence: str = ""
    scan: str = ""
    track: int = 0
    segment: int = 0
    points: int = 0
    at: Annotated[list[float], Field(min_length=2, max_length=2)] = [0.0, 0.0]


class RunRecord(_Strict):
    """The fields of run.json that are read again; each of them may be absent."""

    fingerprint: str = ""
    poses: str | None = None
    recording: _Recording = _Recording()
    points: dict[str, int] = {}
    tracks: dict[str, int] = {}
    seconds: dict[str, float] = {}
    lag_seconds: float | None = None
    odometry: _Notes = _Notes()
    stages: dict[str, Annotated[str, Field(pattern=r"^\w+$")]] = {}  # used in folder names
    versions: dict[str, str] = {}
    warnings: list[_Warning] = []
    review: _Notes = _Notes()
    quality: dict[str, Any] = {}
