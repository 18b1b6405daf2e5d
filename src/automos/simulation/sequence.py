"""A recording that was never made: scans of a simulated world with exact labels, boxes and poses.

Nothing is kept but names and numbers; a scan is cast when it is asked for, always to the same bytes.
"""

from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, inverse, make_transform, rotation_between
from automos.core.label_files import OUTLIER, pack
from automos.core.labels import Label
from automos.core.scan import Pose, Scan, Sequence
from automos.core.upright_boxes import TrueBoxes
from automos.simulation.conditions import Conditions
from automos.simulation.rigs import ride_on, rigs
from automos.simulation.scenarios import build_world
from automos.simulation.sensing.cast import Caster
from automos.simulation.sensing.returns import Cast, add_dust, add_rain, bleed, compensate, measure, read_out
from automos.simulation.sensing.scene import AIR, EGO, Hits
from automos.simulation.sensing.sensors import SENSORS, Pattern, Sensor
from automos.simulation.traffic.motion import transforms
from automos.simulation.truth import Annotations, Verdicts, judge, upright_boxes
from automos.simulation.world import World

FORMAT = 6
"""Counts up whenever equal arguments no longer give equal bytes."""
MOUNT_TILT = 0.006
"""Radians, standard deviation of the sensor's tilt in its mount."""
MOVING_NOW = 0.15
"""m/s above which a body moves at this moment."""
LOOKS_APART = 0.3
"""Seconds between the scans by which objects are judged: nothing passes a sensor in less, and a cast takes its time."""
CASTS_KEPT = 3
"""How many casts a process remembers, so that a scan and its truth cost one."""


@dataclass(unsafe_hash=True, repr=False)
class SimulatedSequence(Sequence):
    """Scans of a simulated world, cast on demand; equal arguments give equal bytes. Made by `simulate`.

    The world frame is the sensor's at the middle of scan 0, as for every sequence; `T_level_world` stands it upright.
    """

    scenario: str
    sensor: Sensor
    n_scans: int
    seed: int
    compensated: bool
    conditions: Conditions = field(default_factory=Conditions)

    def __post_init__(self) -> None:
        self.name = f"{self.scenario}_{self.sensor.name}_{self.seed}".replace(" ", "_")

    def __reduce__(self) -> tuple:
        given = {of.name: getattr(self, of.name) for of in fields(self)}
        return _restore, (type(self), given | {"sensor": self.sensor.name})

    def __len__(self) -> int:
        return self.n_scans

    def __getitem__(self, index: int) -> Scan:
        return self._cast(index).scan

    @property
    def stamps(self) -> Array:
        """(len,) seconds, the middle of each sweep."""
        return (np.arange(len(self), dtype=np.float64) + 0.5) * self.sensor.period

    @property
    def period(self) -> float:
        """Seconds of a sweep."""
        return self.sensor.period

    @property
    def is_compensated(self) -> bool:
        """As asked for."""
        return self.compensated

    @property
    def reference_poses(self) -> Pose:
        """(len, 4, 4) true T_world_sensor at mid-sweep."""
        return self.poses_at(self.stamps)

    def poses_at(self, times: npt.ArrayLike) -> Pose:
        """Return the (..., 4, 4) true T_world_sensor at `times` seconds."""
        return inverse(self._T_site_sensor(self.stamps[0])) @ self._T_site_sensor(times)

    @property
    def T_level_world(self) -> Pose:
        """(4, 4): turns the world upright (least rotation) and puts z = 0 on the ground under the first scan."""
        T = self._T_site_sensor(self.stamps[0])
        height = T[2, 3] - self.world.ground_under_ego
        return make_transform(rotation_between(T[2, :3], [0.0, 0.0, 1.0]), [0.0, 0.0, height])

    def truth(self, index: int) -> npt.NDArray[np.uint32]:
        """Return (N,) labels: MOVING for what moves at some time while observed, instance ids in the upper 16 bits.

        0 if it cannot be said: the ego's own body, missing returns, points between a mover's edge and what lies
        behind, objects that moved by less than an annotator would notice. 1 (outlier) for drops and dust, which are
        no objects but drift with the wind.
        """
        return self._labels(index, self._verdicts.is_moving, self._verdicts.is_static)

    def truth_now(self, index: int) -> npt.NDArray[np.uint32]:
        """Return (N,) labels as `truth`, but MOVING only where the object moves during this very sweep."""
        moving = self._moving_now(index)
        return self._labels(index, moving, ~moving)

    def own_body(self, index: int) -> npt.NDArray[np.bool_]:
        """Return (N,) bool: the points of scan `index` that are on what carries the sensor."""
        cast = self._cast(index)
        return (cast.object == EGO) & cast.scan.is_valid

    def boxes(self, index: int) -> Annotations:
        """Return the objects of which scan `index` holds points."""
        n_points = self._points_on_objects(index)
        rows = np.flatnonzero(n_points > 0)
        states, _ = self.world.object_states(self.stamps[index])
        T_level_site = self.T_level_world @ inverse(self._T_site_sensor(self.stamps[0]))
        boxes = upright_boxes(self.world, rows, states[rows]).transformed(T_level_site)
        kinds = tuple(self.world.objects[k].kind for k in rows)
        is_moving, is_moving_now = self._verdicts.is_moving[rows], self._moving_now(index)[rows]
        return Annotations(boxes, (rows + 1).astype(np.int32), kinds, is_moving, is_moving_now, n_points[rows])

    def truth_boxes(self, index: int) -> TrueBoxes:
        """Return the boxes of scan `index`, in the level frame."""
        found = self.boxes(index)
        return TrueBoxes(found.ids.astype(np.int64), found.boxes, self.T_level_world @ self.reference_poses[index])

    def fingerprint(self) -> str:
        """Return a text that changes when the recording does."""
        return f"{super().fingerprint()}:{FORMAT}:{self.sensor.name}:{self.seed}:{self.compensated}:{self.conditions}"

    # ------------------------------------------------------------------------------------------------ inner workings
    @property
    def world(self) -> World:
        """The world; built when first asked for, once per process."""
        return _world(self.scenario, self.seed, len(self) * self.sensor.period, self.conditions.rig)

    def _points_on_objects(self, index: int) -> npt.NDArray[np.int64]:
        """Return (K,) the number of points of scan `index` on each object."""
        found = self._cast(index).object
        return np.bincount(found[found > 0], minlength=len(self.world.objects) + 1)[1:]

    @property
    def _verdicts(self) -> Verdicts:
        in_clear_air = replace(self.conditions, weather="clear", blooming=False)
        return _verdicts(replace(self, compensated=False, conditions=in_clear_air))

    @property
    def _T_body_sensor(self) -> Pose:
        rng = np.random.default_rng([self.seed, 5])
        tilt = MOUNT_TILT * rng.standard_normal(2)
        place = rigs()[self.conditions.rig].mount or (self.sensor.forward, 0.0, self.sensor.height)
        T = transforms(np.array([*place, 0.0, *tilt]))
        return T @ self.conditions.T_first_mount if self.conditions.mount else T

    def _T_site_sensor(self, time: npt.ArrayLike) -> Array:
        return self.world.ego.at(time) @ self._T_body_sensor

    def _moving_now(self, index: int) -> npt.NDArray[np.bool_]:
        half = 0.5 * self.sensor.period
        before, after = (self.world.object_states(self.stamps[index] + side)[0][:, :3] for side in (-half, half))
        moved = np.linalg.norm(after - before, axis=1)
        return (moved > MOVING_NOW * self.sensor.period) & ~self._verdicts.is_static

    def _labels(self, index: int, is_moving, is_static) -> npt.NDArray[np.uint32]:  # type: ignore[no-untyped-def]
        cast = self._cast(index)
        of_object = np.full(len(is_moving) + 1, Label.UNLABELED, np.uint32)
        of_object[0] = Label.STATIC
        of_object[1:][is_static] = Label.STATIC
        of_object[1:][is_moving] = Label.MOVING
        on_object = np.maximum(cast.object, 0)
        labels = np.where(cast.is_clear & (cast.object != EGO), of_object[on_object], Label.UNLABELED)
        labels[cast.object == AIR] = OUTLIER
        return pack(labels, np.where(cast.is_clear, on_object, 0))

    def _cast(self, index: int) -> Cast:
        return _cast(self, self._scan_number(index))

    def _cast_anew(self, index: int) -> Cast:
        sensor = self.sensor
        rng = np.random.default_rng([self.seed, index, 11])
        pattern = sensor.pattern(index)
        middle = float(self.stamps[index])
        phases = (np.arange(sensor.columns) + 0.5) / sensor.columns - 0.5
        T_site_sensor = self._T_site_sensor(middle + phases * sensor.period)
        times = (middle - 0.5 * sensor.period, middle + 0.5 * sensor.period)
        chance = rng.random(len(pattern.direction), np.float32)
        caster = _caster(self.world, self.conditions.rig)
        hits = caster.sweep(pattern, T_site_sensor, self._T_body_sensor, times, sensor.max_range, chance)
        self._disturb(index, pattern, hits)
        returns = measure(sensor, pattern, hits, rng)
        points = returns.distance[:, None] * pattern.direction
        if self.compensated:
            points = compensate(points, pattern, T_site_sensor, self._T_site_sensor(middle))
        return read_out(sensor, pattern, hits, returns, points, middle, self.names[index])

    def _disturb(self, index: int, pattern: Pattern, hits: Hits) -> None:
        """Let weather and bright signs spoil what the beams of a sweep hit."""
        rng = np.random.default_rng([self.seed, index, 12])
        if self.conditions.blooming and not self.sensor.rosette:
            bleed(hits, self.sensor, rng)
        if self.conditions.weather == "rain":
            add_rain(hits, rng)
        if self.conditions.weather == "dust":
            T = self._T_site_sensor(self.stamps)
            # Not by BLAS, whose rounding depends on its threads: a scan is the same whenever it is read.
            direction = np.einsum("ij,kj->ik", pattern.direction, T[index, :3, :3].astype(np.float32))
            add_dust(hits, T[index, :3, 3], direction, T[:, :3, 3], float(self.stamps[index]), self.seed, rng)


def _restore(kind: type[SimulatedSequence], given: dict[str, Any]) -> SimulatedSequence:
    return kind(**given | {"sensor": SENSORS[given["sensor"]]})


@lru_cache(maxsize=2)
def _world(scenario: str, seed: int, duration: float, rig: str) -> World:
    return ride_on(build_world(scenario, seed, duration), rigs()[rig])


@lru_cache(maxsize=2)
def _verdicts(sequence: SimulatedSequence) -> Verdicts:
    period = sequence.sensor.period
    scans = range(0, len(sequence), max(round(LOOKS_APART / period), 1))
    is_seen = np.array([sequence._points_on_objects(i) > 0 for i in scans])
    return judge(sequence.world, is_seen, sequence.stamps[scans.start : scans.stop : scans.step], period)


@lru_cache(maxsize=2)
def _caster(world: World, rig: str) -> Caster:
    return Caster(world, rigs()[rig])


@lru_cache(maxsize=CASTS_KEPT)
def _cast(sequence: SimulatedSequence, index: int) -> Cast:
    return sequence._cast_anew(index)
