"""How recorders keep a drive, and what else befalls recordings: cut, ordered, timed, carried, thinned, turned.

A case of `CASES` is written as that recorder would have written it and read back as anyone's recording is; one of
`ALTERED` changes the scans on their way. What a carrier costs (boat, truck, backpack) is measured against the same
drive with its points left out, since it moves in its own way, and whoever would pass through it is gone.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from automos import open_sequence
from automos.core.geometry import make_transform, transform
from automos.core.pose_files import interpolate_poses
from automos.core.scan import Pose, Scan, Sequence
from automos.simulation import Conditions, Convention, record, write_recorded
from automos.simulation.recorders import Recorded


@dataclass(frozen=True)
class Recording:
    """What is measured: the scans, which of their points are on what carries the sensor, whether poses get noise."""

    sequence: Sequence
    bodies: Callable[[int], npt.NDArray[np.bool_]] | None = None
    has_noisy_poses: bool = False


@dataclass(frozen=True)
class Case:
    """A recorder and its surroundings, and the case that its cost is measured against.

    Attributes
    ----------
    convention, conditions : how points are kept; what carries the sensor, and the weather.
    n_lidars, knows_mounts : how many LiDARs there are, and whether the recorder says whose each point is.
    is_cut_free : whether the points on what carries the sensor are left out.
    against : name of the case that has the same drive without what this one is about.
    """

    convention: Convention = field(default_factory=Convention)
    conditions: Conditions = field(default_factory=Conditions)
    n_lidars: int = 1
    knows_mounts: bool = False
    is_cut_free: bool = False
    against: str = "plain"


def _kept(**about: object) -> Case:
    return Case(Convention(**about))


def _made(**about: object) -> Case:
    return Case(conditions=Conditions(**about))  # type: ignore[arg-type]


def _carried(rig: str) -> dict[str, Case]:
    """Return the case of a carrier, and that of the same drive with the points on the carrier left out.

    A carrier moves in its own way, and whoever would pass through it is gone: it is another drive than the plain one.
    """
    conditions, cut_free = Conditions(rig=rig), f"{rig}, its points left out"
    return {
        cut_free: Case(conditions=conditions, is_cut_free=True),
        rig: Case(conditions=conditions, against=cut_free),
    }


CASES: dict[str, Case] = {
    "plain": Case(),
    "in time order": _kept(order="time"),
    "beam by beam": _kept(order="ring"),
    "shuffled": _kept(order="random"),
    "cut every 0.8 turns": _kept(turns=0.8, order="time"),
    "cut every 0.92 turns": _kept(turns=0.92, order="time"),
    "cut every 1.09 turns": _kept(turns=1.09, order="time"),
    "cut every 1.2 turns": _kept(turns=1.2, order="time"),
    "cut every 1.09 turns, no stamps": _kept(turns=1.09, order="time", stamps=False),
    "cut every 1.09 turns, beam by beam": _kept(turns=1.09, order="ring"),
    "cut every 0.92 turns, shuffled": _kept(turns=0.92, order="random"),
    "cut every 1.09 turns, shuffled": _kept(turns=1.09, order="random"),
    "cut every 1.2 turns, shuffled": _kept(turns=1.2, order="random"),
    "cut every 1.09 turns, relative times": _kept(turns=1.09, order="time", times="relative"),
    "cut every 1.09 turns, shuffled, relative times": _kept(turns=1.09, order="random", times="relative"),
    "cut every 1.09 turns, absolute times, no stamps": _kept(turns=1.09, order="time", times="absolute", stamps=False),
    "relative times": _kept(times="relative"),
    "absolute times": _kept(times="absolute"),
    "times in milliseconds": _kept(times="milliseconds"),
    "times that run backwards": _kept(times="backwards"),
    "times all the same": _kept(times="constant"),
    "times that are no numbers": _kept(times="nan"),
    "times twice too long": _kept(times="too long"),
    "compensated to the start": _kept(reference="start"),
    "compensated to the middle": _kept(reference="middle"),
    "compensated to the end": _kept(reference="end"),
    "compensated to the middle, times kept": _kept(reference="middle", times="relative"),
    "compensated by 90 % of the speed": _kept(reference="middle", reference_speed=0.9),
    "2 % of the packets lost": _kept(lost_packets=0.02),
    "every 7th scan lost": _kept(leave_out=7),
    "every 7th scan lost, no stamps": _kept(leave_out=7, stamps=False),
    "every 10th scan twice": _kept(double=10),
    "every 10th scan twice, no stamps": _kept(double=10, stamps=False),
    "renumbered": _kept(renumbered=True),
    "renumbered, no stamps": _kept(renumbered=True, stamps=False),
    "renumbered, absolute times, no stamps": _kept(renumbered=True, times="absolute", stamps=False),
    "two scans merged": _kept(turns=2.0),
    "every 2nd scan kept": _kept(every=2),
    "every 2nd scan kept, no stamps": _kept(every=2, stamps=False),
    "coordinates in centimetres": _kept(unit=0.01),
    "coordinates rounded to 2 cm": _kept(rounding=0.02),
    "every 4th beam": _kept(beams=4),
    "front 120 degrees": _kept(field_of_view=120.0),
    "a sector of 60 degrees lost": _kept(lost_sector=60.0),
    "1 % specks in the air": _kept(specks=0.01),
    "two LiDARs": Case(n_lidars=2),
    "two LiDARs, mounts known": Case(n_lidars=2, knows_mounts=True),
    "three LiDARs": Case(n_lidars=3),
    "three LiDARs, mounts known": Case(n_lidars=3, knows_mounts=True),
    **_carried("boat"),
    **_carried("truck"),
    **_carried("backpack"),
    "rain": _made(weather="rain"),
    "dust": _made(weather="dust"),
    "blooming": _made(blooming=True),
}
"""All conventions by name."""


class InMemory:
    """Sweeps that are cast once and kept, for many recorders to cut; without the points on the carrier, if asked."""

    def __init__(self, inner, is_cut_free: bool = False):  # type: ignore[no-untyped-def]
        self._inner, self.name, self.period, self.stamps = inner, inner.name, inner.period, inner.stamps
        self.poses_at = inner.poses_at
        kept = [~inner.own_body(k) if is_cut_free else slice(None) for k in range(len(inner))]
        self._scans: list[Scan] = [_part(inner[k], rows) for k, rows in enumerate(kept)]
        self._truth = [inner.truth(k)[rows] for k, rows in enumerate(kept)]

    def __len__(self) -> int:
        return len(self._scans)

    def __getitem__(self, index: int) -> Scan:
        return self._scans[index]

    def truth(self, index: int) -> npt.NDArray[np.uint32]:
        return self._truth[index]

    def own_body(self, index: int) -> npt.NDArray[np.bool_]:
        """Return (N,) which points of sweep `index` are on what carries the sensor."""
        return self._inner.own_body(index)


def _part(scan: Scan, rows: npt.NDArray[np.bool_] | slice) -> Scan:
    columns = ("points", "intensity", "time", "ring", "sensor")
    part = {name: getattr(scan, name)[rows] for name in columns if getattr(scan, name) is not None}
    return replace(scan, **part)


PERIOD = 0.1
"""Seconds of a turn where the recording has no clock."""
BACK_TO_START = 5.5
"""Radians by which azimuth falls from one point to the next where the next beam's begin."""


class TurnsByAzimuth(Sequence):
    """A sequence of sweeps of one turn each, with times from azimuth and, where they have none, beams from order.

    Parameters
    ----------
    inner : Sequence
        The sweeps, raw.
    turn : int
        +1 for a sensor that turns counter-clockwise seen from above, -1 for clockwise.
    seam_deg : float
        Azimuth at which sweeps begin and end, degrees from +x towards +y.
    """

    def __init__(self, inner: Sequence, turn: int = -1, seam_deg: float = 180.0):
        self._inner, self._turn, self._seam = inner, turn, np.radians(seam_deg)
        self.name = inner.name

    def __len__(self) -> int:
        return len(self._inner)

    def __getitem__(self, index: int) -> Scan:
        scan = self._inner[index]
        azimuth = np.arctan2(scan.points[:, 1], scan.points[:, 0]).astype(np.float64)
        share = (self._turn * (azimuth - self._seam) / (2.0 * np.pi)) % 1.0
        ring = rings_from_order(azimuth) if scan.ring is None else scan.ring
        return replace(scan, time=(share * self.period).astype(np.float32), ring=ring)

    @property
    def names(self) -> list[str]:
        """As the sweeps' own."""
        return self._inner.names

    @property
    def period(self) -> float:
        """Seconds of a turn."""
        stamps = self._inner.stamps
        return PERIOD if stamps is None or len(stamps) < 2 else float(np.median(np.diff(stamps)))

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        """(len,) seconds of the sweeps' middles; PERIOD apart where there is no clock."""
        stamps = self._inner.stamps
        return PERIOD * (np.arange(len(self), dtype=np.float64) + 0.5) if stamps is None else stamps

    @property
    def reference_poses(self) -> Pose | None:
        """As the sweeps' own."""
        return self._inner.reference_poses

    def poses_at(self, times: npt.NDArray[np.float64]) -> Pose:
        """Return the (len(times), 4, 4) reference poses at `times`, between those of the sweeps."""
        poses = self._inner.reference_poses
        if poses is None:
            raise ValueError(f"{self.name} has no poses")
        return interpolate_poses(self.stamps, poses, times)

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """As the sweeps' own."""
        return self._inner.truth(index)


def rings_from_order(azimuth: npt.NDArray[np.float64]) -> npt.NDArray[np.uint16]:
    """Return (N,) beams of points kept beam by beam, each beam's by rising azimuth from 0 to a full turn.

    A beam that saw nothing is not counted: numbers are in order, and may be too low.
    """
    onward = azimuth % (2.0 * np.pi)
    return np.concatenate([[0], np.cumsum(np.diff(onward) < -BACK_TO_START)]).astype(np.uint16)[: len(azimuth)]


def kept_by(case: Case, source: tuple[str, str, int, int] | Sequence, folder: Path) -> Recording:
    """Return a world, by scenario, sensor, scans and seed, or real raw sweeps, one turn each, as `case` has them."""
    if isinstance(source, Sequence):
        recorded = Recorded(TurnsByAzimuth(source), case.convention)
        return Recording(open_sequence(write_recorded(recorded, folder)))
    scenario, sensor, n_scans, seed = source
    made = record(scenario, sensor, n_scans, seed, conditions=case.conditions, n_lidars=case.n_lidars)
    turns = InMemory(made.turns, case.is_cut_free)
    recorded = Recorded(turns, case.convention, seed)  # type: ignore[arg-type]
    sequence: Sequence = recorded
    if not case.knows_mounts:  # files of this layout cannot say
        sequence = open_sequence(write_recorded(recorded, folder))
    has_bodies = case.convention == Convention() and not case.is_cut_free
    return Recording(sequence, turns.own_body if has_bodies else None)


class Altered(Sequence):
    """Some scans of a sequence in some order, each of them changed."""

    def __init__(
        self,
        inner: Sequence,
        order: npt.NDArray[np.int64],
        keep: Callable[[int, Scan], npt.NDArray] | None = None,
        T: npt.NDArray[np.float64] | None = None,
    ):
        """Take the scans `order` of `inner`; of scan i the points `keep(i, scan)`; seen by a sensor turned by `T`."""
        self._inner, self._order, self._keep, self._T = inner, order, keep, T
        self.name = inner.name

    def __len__(self) -> int:
        return len(self._order)

    def _kept(self, index: int) -> npt.NDArray | slice:
        return slice(None) if self._keep is None else self._keep(index, self._inner[int(self._order[index])])

    def __getitem__(self, index: int) -> Scan:
        scan = self._inner[int(self._order[index])]
        points = scan.points if self._T is None else transform(self._T, scan.points)
        time = scan.time
        if time is not None and self._is_backwards:
            time = -time
        kept = self._kept(index)
        columns = {
            name: None if column is None else column[kept]
            for name, column in (("intensity", scan.intensity), ("ring", scan.ring), ("time", time))
        }
        return replace(scan, points=points[kept], stamp=None, name="", **columns)

    @property
    def _is_backwards(self) -> bool:
        return len(self._order) > 1 and bool(self._order[0] > self._order[-1])

    @property
    def stamps(self) -> npt.NDArray[np.float64] | None:
        stamps = self._inner.stamps
        if stamps is None:
            return None
        return -stamps[self._order] if self._is_backwards else stamps[self._order]

    @property
    def is_compensated(self) -> bool | None:
        return self._inner.is_compensated

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        found = self._inner.truth(int(self._order[index]))
        return None if found is None else found[self._kept(index)]


def half_of_the_points(index: int, scan: Scan) -> npt.NDArray[np.bool_]:
    return np.random.default_rng(index).random(len(scan)) < 0.5


def turned(*degrees: float) -> npt.NDArray[np.float64]:
    return make_transform(Rotation.from_euler("xyz", degrees, degrees=True).as_matrix())


def noisy(poses: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return `poses` (N, 4, 4), each disturbed by a standard deviation of 5 cm and 0.1 degrees in all."""
    rng = np.random.default_rng(0)
    shift, turn = rng.standard_normal((2, len(poses), 3)) / np.sqrt(3.0)
    noise = [
        make_transform(Rotation.from_rotvec(np.radians(0.1) * r).as_matrix(), 0.05 * t)
        for t, r in zip(shift, turn, strict=True)
    ]
    return poses @ np.array(noise)


ALTERED: dict[str, Callable[[Sequence], Sequence]] = {
    "as it is": lambda s: Altered(s, np.arange(len(s))),
    "every 2nd scan": lambda s: Altered(s, np.arange(0, len(s), 2)),
    "half the points": lambda s: Altered(s, np.arange(len(s)), half_of_the_points),
    "reversed": lambda s: Altered(s, np.arange(len(s))[::-1]),
    "tilted by 5 degrees": lambda s: Altered(s, np.arange(len(s)), T=turned(3.0, 4.0, 0.0)),
    "upside down": lambda s: Altered(s, np.arange(len(s)), T=turned(180.0, 0.0, 0.0)),
    "noisy poses": lambda s: Altered(s, np.arange(len(s))),
}
"""What is done to a recording; with `noisy poses`, the estimated ones are disturbed by 5 cm and 0.1 degrees a scan."""
