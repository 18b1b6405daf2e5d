"""Array types, and the check that turns what a caller passes into an array of the right type and shape."""

from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError

Points = npt.NDArray[np.float32]
"""(N, 3) coordinates in metres."""
Pose = npt.NDArray[np.float64]
"""(4, 4) rigid transform, or (N, 4, 4)."""
Mask = npt.NDArray[np.bool_]
Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Item = TypeVar("Item", covariant=True)


class Items(Protocol[Item]):
    """What has a length, and an item for each index."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> Item: ...


def as_array(values: npt.ArrayLike, dtype: npt.DTypeLike, shape: tuple[int | str, ...], what: str) -> npt.NDArray[Any]:
    """Return `values` as a contiguous array of `dtype`; an array that already is one is not copied.

    Parameters
    ----------
    values : array_like
        Real numbers. Where `dtype` is an integer type, whole numbers in its range.
    dtype : dtype
        Type of the result.
    shape : tuple of int or str
        Length of each axis; a letter allows any length.
    what : str
        Name of the array in error messages.

    Returns
    -------
    array of `shape` and `dtype`
        Contiguous.

    Raises
    ------
    InputError
        The values are not such numbers, or have another shape.
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
    """Convert attribute `field` of a frozen dataclass to an array, see `as_array`; None stays if `is_optional`."""
    given = getattr(owner, field)
    if given is not None or not is_optional:
        object.__setattr__(owner, field, as_array(given, dtype, shape, field))


def some_of(n: int, most: int) -> npt.NDArray[np.int64]:
    """Return at most `most` of the numbers from 0 to `n` - 1, evenly, the first and the last among them."""
    return np.unique(np.linspace(0, n - 1, most).round().astype(int)) if n > 0 else np.zeros(0, np.int64)


def evenly_spread(items: Items[Item], most: int) -> list[Item]:
    """Return up to `most` of `items`, evenly spread, the first and the last among them."""
    return [items[i] for i in np.linspace(0, len(items) - 1, min(len(items), most)).astype(int).tolist()]
