"""A recording in memory: scans or plain arrays, with the same interface as any other recording."""

import hashlib
from collections.abc import Iterable
from collections.abc import Sequence as Sequence_
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.arguments import require_kind
from automos.core.arrays import as_array
from automos.core.errors import InputError
from automos.core.scan import Mask, Scan, Sequence


class ArraySequence(Sequence):
    """A recording in memory, made of scans or plain arrays.

    Parameters
    ----------
    scans : list of Scan or of (M, 3) or (M, 4) float arrays
        One per sweep: x, y, z in metres in the sensor frame, and optionally the intensity.
    stamps : (N,) float64, optional
        Time of each of the N scans in seconds. If not given, the scans' own stamps, if all of them have one.
    name : str, default "memory"
        Name of the recording.
    is_compensated : bool, optional
        Whether the sensor's motion during the sweep was already removed. Found out from the scans if not given.

    Raises
    ------
    InputError
        An array of another shape, or stamps that do not fit the scans.

    Examples
    --------
    >>> import numpy as np
    >>> import automos
    >>> scans = [np.zeros((100, 3)), np.zeros((90, 4))]
    >>> recording = automos.ArraySequence(scans, stamps=[0.0, 0.1], name="empty room")
    >>> recording
    <ArraySequence 'empty room': 2 scans>
    >>> recording[1]
    <Scan '000001': 90 points, x y z intensity>
    """

    def __init__(
        self,
        scans: Sequence_[Scan | npt.ArrayLike],
        stamps: npt.ArrayLike | None = None,
        name: str = "memory",
        is_compensated: bool | None = None,
    ):
        require_kind(name, str, "the name of a sequence", "a text")
        self.name = name
        require_kind(is_compensated, bool | np.bool_ | None, "is_compensated", "True, False or None")
        require_kind(scans, Iterable, "scans", "a list with an array for each scan")
        self._scans = [scan if isinstance(scan, Scan) else _scan_from_array(scan, i) for i, scan in enumerate(scans)]
        n_lidars = [scan.n_sensors for scan in self._scans]
        if len(set(n_lidars)) > 1:
            odd = next(i for i, n in enumerate(n_lidars) if n != n_lidars[0])
            raise InputError(
                f"scan {odd} is of {n_lidars[odd]} LiDARs, scan 0 of {n_lidars[0]}: name the same LiDARs in all scans"
            )
        if stamps is None and self._scans and all(s.stamp is not None for s in self._scans):
            stamps = np.array([s.stamp for s in self._scans], np.float64)
        self._stamps = None if stamps is None else as_array(stamps, np.float64, (len(self._scans),), "stamps")
        self._is_compensated = is_compensated

    def __len__(self) -> int:
        return len(self._scans)

    def __getitem__(self, index: int) -> Scan:
        return self._scans[index]

    @property
    def names(self) -> list[str]:
        """The scans' own names where each has another that can be a file's, else their numbers."""
        names = [scan.name for scan in self._scans]
        are_of_files = all(name.isprintable() and name == Path(name).name != "" for name in names)
        return names if are_of_files and len(set(names)) == len(names) else super().names

    @property
    def stamps(self) -> npt.NDArray[np.float64] | None:
        """(len,) seconds or None."""
        return self._stamps

    @property
    def repeats(self) -> Mask:
        """(len,) bool: scans whose points are those of the one before; none without a valid point repeats another."""
        pairs = zip(self._scans[:-1], self._scans[1:], strict=True)
        are_same = (np.array_equal(a.points, b.points, equal_nan=True) and a.is_valid.any() for a, b in pairs)
        return np.array([False, *are_same][: len(self)])

    @property
    def is_compensated(self) -> bool | None:
        """As given to the constructor."""
        return self._is_compensated

    def fingerprint(self) -> str:
        """Return a text that changes when any point, time or stamp does."""
        digest = hashlib.sha256(repr(self._is_compensated).encode())
        for scan in self._scans:
            for column in (scan.points, scan.time, scan.sensor, scan.T_scan_sensor):
                if column is not None:
                    digest.update(f"{column.dtype}{column.shape}".encode())
                    digest.update(np.ascontiguousarray(column).tobytes())
        if self._stamps is not None:
            digest.update(self._stamps.tobytes())
        return f"{super().fingerprint()}:{digest.hexdigest()}"


def as_scan(scan: Scan | npt.ArrayLike, stamp: float | None = None) -> Scan:
    """Return `scan` as a `Scan` with arrays of its own, at `stamp` seconds if given.

    Callers may write the next scan into the same buffer while this one is in use.

    Raises
    ------
    InputError : it is not an array of points, or `stamp` not a number.
    """
    if not isinstance(scan, Scan):
        try:
            scan = _scan_from_array(scan, 0)
        except (TypeError, ValueError) as error:
            raise InputError(f"a scan is a Scan or an (N, 3) array, metres: {error}") from None
    values = {field.name: getattr(scan, field.name) for field in fields(scan)}
    own: dict[str, Any] = {name: value.copy() for name, value in values.items() if isinstance(value, np.ndarray)}
    try:
        return replace(scan, **own, stamp=scan.stamp if stamp is None else float(stamp))
    except (TypeError, ValueError):
        raise InputError(f"a scan's stamp is seconds, not {stamp!r}") from None


def _scan_from_array(array: npt.ArrayLike, index: int) -> Scan:
    array = as_array(array, np.float32, ("N", "3 or 4"), f"scan {index}")
    if array.shape[1] not in (3, 4):
        raise InputError(f"scan {index} must be (N, 3 or 4), got shape {array.shape}")
    return Scan(array[:, :3], array[:, 3] if array.shape[1] == 4 else None, name=f"{index:06d}")
