"""What callers give as a recording, checked: a list of scans, or a sequence class of their own.

Of a class, InputError for a value that does not fit, when it is read.
"""

from collections.abc import Iterable
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.array_rows import are_scans
from automos.core.array_sequence import ArraySequence
from automos.core.arrays import as_array
from automos.core.errors import InputError
from automos.core.scan import Mask, Pose, Scan, Sequence
from automos.core.upright_boxes import TrueBoxes


def as_sequence(recording: Sequence | Iterable[Scan | npt.ArrayLike]) -> Sequence:
    """Return `recording` where it is a sequence (what a caller's own class gives is checked), else that of its scans.

    Raises
    ------
    InputError : it is a path, one single array of points, empty, or holds what is not a scan.
    """
    if isinstance(recording, Sequence):
        is_ours = type(recording).__module__.partition(".")[0] == __name__.partition(".")[0]
        return recording if is_ours else OwnSequence(recording)
    if isinstance(recording, str | Path):
        raise InputError(f"a path is opened first: automos.open_sequence({str(recording)!r}) is what label takes")
    if isinstance(recording, np.ndarray) and recording.ndim in (2, 3) and recording.dtype.kind in "fiu":
        are = recording.ndim == 3 and are_scans(recording)
        if not are:
            is_what = (
                "is one scan" if are is False else f"may be {len(recording)} scans or one, as its points do not tell"
            )
            raise InputError(f"one array of shape {recording.shape} {is_what}: give a list with an array for each scan")
    try:
        sequence = ArraySequence(list(recording))
    except (TypeError, ValueError, NotImplementedError) as error:  # the last is what views of memory say of rows
        raise InputError(f"a recording is a sequence or a list of (N, 3) arrays, metres: {error}") from None
    if not len(sequence):
        raise InputError("a list without scans is not a recording: give an array for each scan")
    return sequence


class OwnSequence(Sequence):
    """What a class of the caller's gives, or InputError that names the class, the property and what it should be."""

    def __init__(self, given: Sequence):
        """Take the caller's sequence; its scans are looked at when they are asked for."""
        self._given = given
        self._n_sensors: int | None = None  # LiDARs of each scan, known from the first one
        self._reading = Lock()  # stages ask for scans in several threads, but one open file has one position
        try:
            self._n = len(given)
        except (TypeError, ValueError, NotImplementedError) as error:
            raise self._unfit("__len__", f"the number of scans ({str(error) or 'it is not there'})") from error
        self.name, self.source = given.name, self._place("source")
        self._require(isinstance(self.name, str), "name", "a text", self.name)

    def __len__(self) -> int:
        return self._n

    def __getstate__(self) -> dict[str, Any]:
        """Return what another process gets: locks are of one process."""
        return {name: value for name, value in vars(self).items() if name != "_reading"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what `__getstate__` returned."""
        self.__dict__.update(state, _reading=Lock())

    def __getitem__(self, index: int) -> Scan:
        try:
            with self._reading:
                scan = self._given[index]
        except (IndexError, NotImplementedError, StopIteration) as error:
            why = f"{type(error).__name__}{f': {error}' if str(error) else ''}"
            raise self._unfit("__getitem__", f"each of its {self._n} scans (scan {index} ends in {why})") from error
        if not isinstance(scan, Scan):
            found = f"as scan {index} it gives a {type(scan).__name__}; automos.Scan(points) makes one of an array"
            raise self._unfit("__getitem__", f"an automos.Scan ({found})")
        self._n_sensors = self._n_sensors or scan.n_sensors
        if scan.n_sensors != self._n_sensors:
            found = f"scan {index} is of {scan.n_sensors}, an earlier one of {self._n_sensors}"
            raise self._unfit("__getitem__", f"scans of the same LiDARs ({found})")
        return scan

    def _unfit(self, what: str, wish: str) -> InputError:
        return InputError(f"{type(self._given).__name__}.{what} must give {wish}")

    def _require(self, is_so: bool, what: str, wish: str, value: object) -> None:
        if not is_so:
            raise self._unfit(what, f"{wish}, not {value!r:.80}")

    def _place(self, what: str) -> Path | None:
        value = getattr(self._given, what)
        self._require(value is None or isinstance(value, str | Path), what, "a pathlib.Path or None", value)
        return None if value is None else Path(value)

    def _array(self, what: str, dtype: npt.DTypeLike, *shape: int) -> npt.NDArray[Any] | None:
        value = getattr(self._given, what)
        return None if value is None else as_array(value, dtype, shape, f"{type(self._given).__name__}.{what}")

    @property
    def address(self) -> Path | None:
        """As the caller's class has it."""
        return self._place("address")

    @property
    def names(self) -> list[str]:
        """As the caller's class has it; where results are kept, that is where they are looked at."""
        return self._given.names

    @property
    def stamps(self) -> npt.NDArray[np.float64] | None:
        """(len,) seconds, or None."""
        return self._array("stamps", np.float64, self._n)

    @property
    def is_compensated(self) -> bool | None:
        """As the caller's class has it."""
        given = self._given.is_compensated
        self._require(given is None or isinstance(given, bool | np.bool_), "is_compensated", "a bool or None", given)
        return None if given is None else bool(given)

    @property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) or None."""
        return self._array("reference_poses", np.float64, self._n, 4, 4)

    @property
    def repeats(self) -> Mask | None:
        """(len,) bool, or None."""
        given = self._array("repeats", np.float64, self._n)
        return None if given is None else given != 0.0

    @property
    def warnings(self) -> list[str]:
        """As the caller's class has it."""
        given = self._given.warnings
        are_texts = isinstance(given, list) and all(isinstance(sentence, str) for sentence in given)
        self._require(are_texts, "warnings", "a list of sentences", given)
        return given

    @property
    def T_vehicle_sensor(self) -> Pose | None:
        """(4, 4) or None."""
        return self._array("T_vehicle_sensor", np.float64, 4, 4)

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return what the caller's class gives."""
        return self._given.truth(index)

    def truth_motion(self, index: int) -> npt.NDArray[np.float32] | None:
        """Return what the caller's class gives."""
        return self._given.truth_motion(index)

    def truth_boxes(self, index: int) -> TrueBoxes | None:
        """Return what the caller's class gives."""
        return self._given.truth_boxes(index)

    def fingerprint(self) -> str:
        """Return what the caller's class gives."""
        given = self._given.fingerprint
        found = given() if callable(given) else None
        self._require(isinstance(found, str), "fingerprint()", "a text", found)
        return str(found)
