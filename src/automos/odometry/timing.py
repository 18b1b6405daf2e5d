"""The timing of a sweep: when in it each point was measured, where the recording does not say.

Wrongly timed sweeps are bent, and poses estimated from them are biased to match: a driver that cuts its stream every
1.09 turns makes every step 8 % too short, and neighbouring scans agree perfectly. So each hypothesis about the times is
registered anew: a few seconds of scans are aligned with their neighbours, then with what was seen half a second to two
apart, and the hypothesis under which walls are thinnest and best met is taken.
"""

from __future__ import annotations

import logging
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from automos.errors import InputError
from automos.odometry.clock import Clock
from automos.odometry.drifting_seam import learn_drifting_seam
from automos.odometry.motion import SweepTiming, recorded_duration, sweep_times
from automos.odometry.moving_windows import MIN_BEND, Search, bend_of, moving_windows
from automos.odometry.sweep_order import learn_order
from automos.scan import Pose, Scan, Sequence
from automos.settings import OdometrySettings

_log = logging.getLogger(__name__)

SEAMS_DEG = (180.0, 0.0, 90.0, -90.0)
"""Azimuths at which sweeps are tried to start, the most usual first: others must be clearly better."""
SAME_TIME = 0.02
"""Share of the time between scans by which two timings of a point may differ and still agree."""
OTHER_MOTION = 0.2
"""Share of the motion in a window that final poses may change: timing changes it by a tenth."""
MOSTLY = 0.95
"""Share of a scan's points for which two timings must agree."""
USUAL_PERIODS = (0.1, 0.05)
"""Seconds in which sensors turn."""
N_LIKELY = 3
"""Seams that are compared closely."""


@dataclass(frozen=True)
class TimingChoice:
    """The timing that was taken, and what it was measured against.

    Attributes
    ----------
    timing : the best.
    misfits : of each hypothesis tried, in words, the logarithm of how thick walls are over how much of them is met,
        less that of the first; empty where nothing had to be, or could be, decided.
    rough : what it was decided on: the first scan of each window and the (n, 4, 4) rough poses of its scans.
    """

    timing: SweepTiming
    misfits: dict[str, float] = field(default_factory=dict)
    rough: tuple[tuple[int, Pose], ...] = ()

    def suits(self, poses: Pose) -> bool:
        """Whether the final (N, 4, 4) `poses` confirm the motion in the windows, or that there was none."""
        if not self.rough:
            return bend_of(poses) < MIN_BEND
        bends = [(bend_of(T), bend_of(poses[first : first + len(T)])) for first, T in self.rough]
        return all(abs(then - now) < OTHER_MOTION * max(then, now) for then, now in bends)

    def to_dict(self) -> dict[str, object]:
        """Return what was chosen, and by how many percent its rivals are worse, the next best first."""
        best = self.misfits.get(str(self.timing), 0.0)
        rivals = {name: round(100.0 * float(np.expm1(m - best)), 1) for name, m in self.misfits.items()}
        rivals.pop(str(self.timing), None)
        return {"chosen": str(self.timing), "worse_percent": dict(sorted(rivals.items(), key=lambda item: item[1]))}


def choose_timing(
    sequence: Sequence,
    settings: OdometrySettings,
    poses: Pose | None,
    clock: Clock,
    pool: ThreadPoolExecutor | None = None,
) -> TimingChoice:
    """Return how the time of each point within its sweep is known, as `settings.time` asks.

    Raises
    ------
    InputError
        When the file's times are asked for and there are none, or the order of points and it tells nothing.
    """
    wanted = settings.time
    if wanted == "none" or (wanted == "auto" and sequence.is_compensated):
        return TimingChoice(SweepTiming())
    timed = _recorded_timings(sequence, clock, wanted)
    if wanted in ("file", "order"):
        return TimingChoice(timed[0])
    is_round = sees_all_round(sequence)
    if wanted == "auto" and not timed and not is_round:
        return TimingChoice(SweepTiming())
    is_by_azimuth = is_round and all(timing.source != "order" for timing in timed)
    if len(timed) == 2 and _agree(sequence[len(sequence) // 2], *timed):
        timed = timed[:1]
    drifting = _drifting_timing(sequence) if is_by_azimuth else None
    from_points = [*timed, *([] if drifting is None else [drifting])]
    sources: dict[str, SweepTiming] = {"raw": SweepTiming(), **{timing.source: timing for timing in from_points}}
    untimed = [] if sequence.is_compensated is False or wanted == "azimuth" else [SweepTiming()]
    search, best = Search(settings, pool), None
    for window in moving_windows(sequence, settings, poses, clock, sources, pool):
        search.add(window)
        best = _best_hypothesis(search, timed, untimed, is_by_azimuth, drifting, clock)
        if search.is_clear:
            break
    if best is None:  # nothing moves, so nothing bends, or there is too little to see
        from_file = [timing for timing in timed if timing.source == "file"]
        return TimingChoice([*from_file, *untimed, *timed, rear_seam()][0])
    choice = TimingChoice(best, search.misfits, tuple((w.first, w.T_world_sensor) for w in search.windows))
    _log.info("sweep timing: %s", choice.to_dict())
    return choice


def _best_hypothesis(
    search: Search,
    timed: list[SweepTiming],
    untimed: list[SweepTiming],
    is_by_azimuth: bool,
    drifting: SweepTiming | None,
    clock: Clock,
) -> SweepTiming | None:
    """Return the best of all that may be: recorded times, none, by azimuth; or in a part of the time between scans."""
    best = search.best([*timed, *untimed], [replace(timing, share=-timing.share) for timing in timed[:1]])
    if is_by_azimuth and (best is None or best.source == "none"):
        best = _best_seam(search, untimed) if drifting is None else search.best([drifting, *untimed])
    if best is None or best.source == "none":
        return best
    shorter = [replace(best, share=share * best.share) for share in _shares(best, clock)]
    is_shorter = len(shorter) > 0 and search.likeliest([best, *shorter], 1) != [best]
    return search.best([best], shorter) if is_shorter else best


def _best_seam(search: Search, untimed: list[SweepTiming]) -> SweepTiming | None:
    """Return the best timing by azimuth with a seam that stays where it is, or `untimed`."""
    circle = [SweepTiming("azimuth", turn=turn, seam_deg=seam, share=1.0) for seam in SEAMS_DEG for turn in (-1, 1)]
    (found,) = search.likeliest(circle, 1)
    around = [((found.seam_deg or 0.0) + off + 180.0) % 360.0 - 180.0 for off in (-45.0, 45.0)]
    likely = search.likeliest([*circle, *(replace(found, seam_deg=seam) for seam in around)], N_LIKELY)
    found_among_all = search.best([*untimed, *likely])
    return found_among_all if found_among_all == SweepTiming() else search.best(likely)


def _shares(timing: SweepTiming, clock: Clock) -> list[float]:
    """Return which part of the time between scans a sweep may have taken, if scans were left out."""
    if timing.source == "file":  # its times say how long a sweep takes
        return []
    usual = [period / clock.period for period in USUAL_PERIODS] if clock.has_stamps else []
    return sorted({0.5, *(round(share, 3) for share in usual if share < 0.45)})


def rear_seam() -> SweepTiming:
    """Return the most usual timing of a sensor that turns: clockwise, from behind to behind."""
    return SweepTiming("azimuth", turn=-1, seam_deg=SEAMS_DEG[0], share=1.0)


def _recorded_timings(sequence: Sequence, clock: Clock, wanted: str) -> list[SweepTiming]:
    """Return the timings that follow from the file's times and from the order of its points, as far as they are wanted.

    Raises
    ------
    InputError
        One of them is asked for, and there is none.
    """
    found = []
    if wanted in ("auto", "file") and (from_file := _file_timing(sequence, clock)):
        found.append(from_file)
    if wanted in ("auto", "order") and (order := learn_order(sequence)):
        found.append(SweepTiming("order", turn=order.turn, share=order.span / order.turns_per_scan, order=order))
    if wanted == "file" and not found:
        raise InputError(f"{sequence.name} has no time per point; set odometry.time to auto, order or none.")
    if wanted == "order" and not found:
        raise InputError(
            f"in {sequence.name} the azimuth does not run on from point to point, so their order tells no time; "
            "set odometry.time to auto, azimuth or none."
        )
    return found


def _agree(scan: Scan, a: SweepTiming, b: SweepTiming) -> bool:
    """Whether two timings agree on the points of a scan."""
    in_a, in_b = sweep_times(scan, a), sweep_times(scan, b)
    if in_a is None or in_b is None:
        return False
    off = np.abs(a.share * in_a - b.share * in_b)[scan.is_valid]
    return bool((off < SAME_TIME).mean() > MOSTLY)


def _drifting_timing(sequence: Sequence) -> SweepTiming | None:
    """Return the timing by a sector that wanders from scan to scan, None where there is none."""
    found = learn_drifting_seam(sequence)
    return None if found is None else SweepTiming("azimuth", turn=found[0], seam_deg=None, turns=found[1], share=1.0)


def _file_timing(sequence: Sequence, clock: Clock) -> SweepTiming | None:
    """Return the timing the scans' own times give, None where they have none."""
    ids = np.unique(np.linspace(0, len(sequence) - 1, 11).round().astype(int))
    scans = [sequence[int(i)] for i in ids]
    durations = [recorded_duration(scan) or 0.0 for scan in scans if scan.time is not None and scan.is_valid.any()]
    if not durations or np.median(durations) == 0.0:
        return None
    duration = float(np.median(durations))
    period = duration if sequence.stamps is None or len(sequence) < 2 else clock.period
    return SweepTiming("file", duration=duration, share=duration / period)


def sees_all_round(sequence: Sequence) -> bool:
    """Whether a scan has points in nearly all directions, as that of a sensor that spins about its z axis."""
    scan = sequence[len(sequence) // 2]
    x, y = scan.points[scan.is_valid, 0], scan.points[scan.is_valid, 1]
    return len(np.unique(np.floor(np.arctan2(y, x) * (18.0 / np.pi)))) >= 30
