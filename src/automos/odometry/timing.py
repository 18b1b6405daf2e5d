"""The timing of sweeps: when each point was measured, if the recording does not provide it.

Wrong point times distort sweeps and bias the poses: if a driver cuts its stream every 1.09 turns, every step is 8 % too
short, and neighbouring scans still agree perfectly. So each hypothesis on the times is tested by aligning scans half a
second to two seconds apart: the one with the thinnest and best overlapping walls is chosen.
"""

import logging
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from automos.core.arrays import evenly_spread
from automos.core.errors import InputError
from automos.core.scan import Pose, Sequence
from automos.odometry.clock import USUAL_PERIOD, Clock
from automos.odometry.drifting_seam import learn_drifting_seam
from automos.odometry.moving_windows import WINDOWS, Search, moving_windows
from automos.odometry.one_lidar import with_one_lidar
from automos.odometry.point_order import SAMPLES, learn_order, sees_all_round
from automos.odometry.sweep_timing import SweepTiming, recorded_duration
from automos.settings import OdometrySettings

_log = logging.getLogger(__name__)

SEAMS_DEG = (180.0, 0.0, 90.0, -90.0)
"""Azimuth seams that are tried, the most common first: others must be clearly better."""
CIRCLE = [SweepTiming("azimuth", turn=turn, seam_deg=seam, share=1.0) for seam in SEAMS_DEG for turn in (-1, 1)]
USUAL_PERIODS = (USUAL_PERIOD, USUAL_PERIOD / 2.0)
"""Seconds, common rotation periods of sensors."""
AT_A_STEADY_RATE = SweepTiming("index", share=1.0)
"""Of a sensor without a rotating head, whose azimuth does not advance: points are appended as they are measured."""
N_LIKELY = 3
"""Seams that are compared in detail."""


@dataclass(frozen=True)
class TimingChoice:
    """The chosen timing and its rivals.

    A misfit is the logarithm of the wall thickness over the matched share, relative to that of the first hypothesis.
    """

    timing: SweepTiming
    misfits: dict[str, float] = field(default_factory=dict)  # of each tested hypothesis, by its text
    is_final: bool = True  # whether more scans would hardly change it

    def to_dict(self) -> dict[str, object]:
        """Return the choice, and by how many percent its rivals are worse, best first."""
        best = self.misfits.get(str(self.timing), 0.0)
        rivals = {name: round(100.0 * float(np.expm1(m - best)), 1) for name, m in self.misfits.items()}
        rivals.pop(str(self.timing), None)
        return {"chosen": str(self.timing), "worse_percent": dict(sorted(rivals.items(), key=lambda item: item[1]))}


def choose_timing(
    sequence: Sequence,
    settings: OdometrySettings,
    poses: Pose,
    clock: Clock,
    pool: ThreadPoolExecutor | None = None,
    assumed: SweepTiming | None = None,
) -> TimingChoice:
    """Return the source of the point times, as requested by `settings.time`.

    What is `assumed` is kept unless the scans align clearly better under another timing.

    Raises
    ------
    InputError
        If the file's times are requested but missing, or if the order of points is requested but gives no times.
    """
    wanted = settings.time
    if wanted == "none" or (wanted == "auto" and sequence.is_compensated):
        return TimingChoice(SweepTiming())
    from_file = _file_timing(sequence, clock) if wanted in ("auto", "file") else None  # of all LiDARs
    sequence, poses = with_one_lidar(sequence, poses)
    timed = _recorded_timings(sequence, from_file, wanted)
    if wanted in ("file", "order"):
        return TimingChoice(timed[0])
    is_round = sees_all_round(sequence)
    is_by_azimuth = is_round and all(timing.source != "order" for timing in timed)
    drifting = _drifting_timings(sequence) if is_by_azimuth else []
    if len(timed) == 2 and timed[0].agrees_with(timed[1], sequence[len(sequence) // 2]):
        timed = timed[:1]
    steady = [] if timed or is_round else [AT_A_STEADY_RATE]
    none = [] if sequence.is_compensated is False else [SweepTiming()]
    untimed = [] if wanted == "azimuth" else [*none, *steady]
    search, best = Search(settings, pool), None
    known = [] if assumed is None or assumed == SweepTiming() or assumed.has_fixed_seam else [assumed]
    from_points = {timing.source: timing for timing in [*known, *timed, *drifting, *steady]}
    for window in moving_windows(sequence, settings, poses, clock, list(from_points.values()), pool):
        search.add(window)
        best = _best_hypothesis(search, timed, untimed, is_by_azimuth, drifting, clock)
        if search.is_clear or len(search.windows) == (WINDOWS if timed else SAMPLES):
            break
    if assumed is not None and (best is None or not search.is_ahead(best, assumed)):
        return TimingChoice(assumed, search.misfits, search.is_clear and best == assumed)
    if best is None:  # no motion, so no distortion, or too few surfaces
        return TimingChoice([*([from_file] if from_file else []), *untimed, *timed, rear_seam()][0])
    choice = TimingChoice(best, search.misfits, search.is_clear)
    _log.info("sweep timing: %s", choice.to_dict())
    return choice


def _best_hypothesis(
    search: Search,
    timed: list[SweepTiming],
    untimed: list[SweepTiming],
    is_by_azimuth: bool,
    drifting: list[SweepTiming],
    clock: Clock,
) -> SweepTiming | None:
    """Return the best hypothesis: recorded times, none, or by azimuth; also over part of the time between scans."""
    reversed_sweeps = [replace(timing, share=-timing.share) for timing in timed[:1]]
    known = [*timed, *untimed]  # what the recording itself says comes first, and the others must be clearly better
    best = search.best(known[:1], selected=[*known[1:], *reversed_sweeps])
    if is_by_azimuth and (best is None or best.source == "none"):
        best = search.best(drifting, selected=untimed) if drifting else _best_seam(search, untimed)
    if best is None:
        return None
    # Of sweeps over half of the time between scans, full compensation is as wrong as none.
    likely = [best] if best.source != "none" else [*timed[:1], *drifting]
    if not likely and is_by_azimuth:
        likely = search.likeliest(CIRCLE, 1)
    shorter = [replace(full, share=share * full.share) for full in likely for share in _shares(full, clock)]
    is_shorter = len(shorter) > 0 and search.likeliest([best, *shorter], 1) != [best]
    return search.best([best], selected=shorter) if is_shorter else best


def _best_seam(search: Search, untimed: list[SweepTiming]) -> SweepTiming | None:
    """Return the best timing by azimuth with a fixed seam, or `untimed`."""
    (found,) = search.likeliest(CIRCLE, 1)
    half = 90.0 / 2.0  # of a quarter turn, by which those of the circle are apart
    around = [((found.seam_deg or 0.0) + off + 180.0) % 360.0 - 180.0 for off in (-half, half)]
    likely = search.likeliest([*CIRCLE, *(replace(found, seam_deg=seam) for seam in around)], N_LIKELY)
    others = [timing for timing in likely if timing.seam_deg != SEAMS_DEG[0]]
    rear = [timing for timing in likely if timing not in others] or [replace(found, seam_deg=SEAMS_DEG[0])]
    best = search.best([*untimed, *rear], selected=others)
    return best if best == SweepTiming() else search.best(rear[:1], selected=[*rear[1:], *others])


def _shares(timing: SweepTiming, clock: Clock) -> list[float]:
    """Return the shares of the time between scans that a sweep may take if scans were dropped."""
    if timing.source == "file":  # its times contain the sweep duration
        return []
    usual = [period / clock.period for period in USUAL_PERIODS] if clock.has_stamps else []
    return sorted({0.5, *(round(share, 3) for share in usual if share < 0.5)})


def rear_seam() -> SweepTiming:
    """Return the most common timing of a rotating sensor: clockwise, with the seam at the rear."""
    return CIRCLE[0]


def _recorded_timings(sequence: Sequence, from_file: SweepTiming | None, wanted: str) -> list[SweepTiming]:
    """Return the timings from the file's times and from the order of its points, as far as they are requested."""
    from_order = order_timing(sequence) if wanted in ("auto", "order") else None
    found = [timing for timing in (from_file, from_order) if timing]
    if wanted == "file" and not found:
        raise InputError(f"{sequence.name} has no time per point; set odometry.time to auto, order or none.")
    if wanted == "order" and not found:
        if not sees_all_round(sequence):
            return [AT_A_STEADY_RATE]
        raise InputError(
            f"in {sequence.name} the azimuth does not advance from point to point, so their order gives no times; "
            "set odometry.time to auto, azimuth or none."
        )
    return found


def order_timing(sequence: Sequence) -> SweepTiming | None:
    """Return the timing from the order of the points; None if it gives no times."""
    if (order := learn_order(sequence)) is None:
        return None
    return SweepTiming("order", turn=order.turn, share=order.span / order.turns_per_scan, order=order)


def _drifting_timings(sequence: Sequence) -> list[SweepTiming]:
    """Return the timing from a sector that drifts from scan to scan, if there is one."""
    found = learn_drifting_seam(sequence)
    return [SweepTiming("azimuth", turn=found[0], seam_deg=None, turns=found[1], share=1.0)] if found else []


def _file_timing(sequence: Sequence, clock: Clock) -> SweepTiming | None:
    """Return the timing from the scans' own times, None if they have none."""
    scans = [sequence[i] for i in evenly_spread(range(len(sequence)), SAMPLES)]
    durations = [recorded_duration(scan) or 0.0 for scan in scans if scan.time is not None and scan.is_valid.any()]
    duration = float(np.median(durations or 0.0))
    if duration == 0.0:
        return None
    period = duration if sequence.stamps is None or len(sequence) < 2 else clock.period
    return SweepTiming("file", duration=duration, share=duration / period)
