"""The base of all groups of settings: names with values, or further groups."""

from typing import Any, Self

from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator, model_validator

LEAST, MOST = 1e-6, 1e9
"""Limits of the magnitude of numbers, beyond which computations overflow. Lengths are in metres, times in seconds; the
largest default is a variance of 1e6."""
MOST_CELLS = 2000
"""Greatest number of cells from the sensor to the border of a ground map, which bounds its memory."""


class Group(BaseModel):
    """A group of settings: validated when created, immutable, without unknown names."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _is_not_boolean(cls, value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, bool) and cls.model_fields[str(info.field_name)].annotation is not bool:
            raise ValueError("it is not a boolean")  # true would be read as 1
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
            raise ValueError(f"max_range is at most {MOST_CELLS} cells: a larger map does not fit into memory")
        return self
