"""What a recording does not say of itself."""

from typing import Annotated

from pydantic import Field

from automos.settings.group import Group


class RecordingSettings(Group):
    """What a recording does not say of itself."""

    rate: float | None = Field(
        None,
        ge=0.1,
        le=1000,
        description="scans a second where none has a time; none: 10 are assumed, and that is said; more is faster",
    )
    rates: dict[str, Annotated[float, Field(ge=0.1, le=1000)]] = Field(
        default_factory=dict,
        description="scans a second of single recordings, by name ({log_1: 5}), instead of rate",
    )
