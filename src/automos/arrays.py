"""What callers give where an array belongs, made into one of the right type and shape, or told in a sentence."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from automos.errors import InputError


def as_array(values: npt.ArrayLike, dtype: npt.DTypeLike, shape: tuple[int | str, ...], what: str) -> npt.NDArray[Any]:
    """Return `values` as a contiguous array of `dtype`.

    Parameters
    ----------
    values : real numbers; whole ones within its range where `dtype` is of whole numbers. No copy is made of an array
        that is one already.
    shape : of each axis its length, or a letter where any will do.
    what : names it in what is raised.

    Raises
    ------
    InputError
        They are no such numbers, or of another shape.
    """
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        raise InputError(f"{what} must be one array of numbers, got rows of different lengths") from None
    if array.dtype.kind not in "fiub":
        raise InputError(f"{what} must be real numbers, got {array.dtype} ({type(values).__name__})")
    wanted = f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)})"
    lengths = zip(array.shape, shape, strict=False)
    if array.ndim != len(shape) or any(isinstance(wish, int) and got != wish for got, wish in lengths):
        raise InputError(f"{what} must be {wanted}, got shape {array.shape}")
    with np.errstate(over="ignore", invalid="ignore"):  # beyond what float32 holds is infinite
        out = np.ascontiguousarray(array, dtype)
    if out.dtype.kind in "iu" and out.dtype != array.dtype and not np.array_equal(out, array):
        raise InputError(f"{what} must be whole numbers that {out.dtype} holds, got {array.min()} to {array.max()}")
    return out


def hold_array(
    owner: object, field: str, dtype: npt.DTypeLike, shape: tuple[int | str, ...], is_optional: bool = False
) -> None:
    """Make what a frozen `owner` was given as `field` the array that it should be; None stays where `is_optional`."""
    given = getattr(owner, field)
    if given is not None or not is_optional:
        object.__setattr__(owner, field, as_array(given, dtype, shape, field))
