"""What every group of settings is: names with values, or further groups."""

from __future__ import annotations

from typing import Any, Self

from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator, model_validator

LEAST, MOST = 1e-6, 1e9
"""Size of numbers with a fraction: beyond these, what is computed from them overflows. Lengths are metres, times
seconds; the widest that anything of ours has is a variance of 1e6."""
MOST_CELLS = 2000
"""From the sensor to the end of a map seen from above: gigabytes of map show nothing more."""


class Group(BaseModel):
    """Settings that belong together: checked when made, unchangeable then, and none beside those named."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _is_no_switch(cls, value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, bool) and cls.model_fields[str(info.field_name)].annotation is not bool:
            raise ValueError("it is no switch")  # true would be taken for 1
        return value

    @field_validator("*")
    @classmethod
    def _is_within_reach(cls, value: Any) -> Any:
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, (int, float)) and number and not LEAST <= abs(number) <= MOST:
                raise ValueError(f"numbers are 0, or between {LEAST:g} and {MOST:g} in size")
        return value

    @model_validator(mode="after")
    def _fits_into_memory(self) -> Self:
        cell, max_range = getattr(self, "cell", None), getattr(self, "max_range", None)
        if cell is not None and max_range is not None and max_range > MOST_CELLS * cell:
            raise ValueError(f"max_range is at most {MOST_CELLS} cells: a map of more does not fit into memory")
        return self
