"""All benchmarks: each a list of experiments, recordings x methods x changes, and what it is good for.

Choices of the method were made on drive 0005, on worlds of seeds 0 to 21, 41, 70 to 94, 101 to 103, 109, 121 to 134 and
141 to 144, on `scooters` of seed 104 with an OS1-128, and on seed 17 of `conventions`. Seeds 60, 100, 104 to 108,
110 to 112 and, of `trust`, 30 to 35 are for these tables: they are scored, not looked at, and so are 200 to 204 of
`calibration`, and 210 and 211 of `objects`. For understanding, simulate other seeds. Networks have the seeds of
`automos.network.domains`.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import product
from typing import Any

from ablation import CHOICES, ODOMETRY, OTHER_METHODS
from cases import ALTERED, CASES
from experiment import Experiment

from automos.network.domains import DOMAINS
from automos.simulation import LONG
from automos.simulation import SCENARIOS as ALL

RIVALS = ("octomap", "removert", "erasor", "pfreundschuh", "yoon", "dufomap", "m_detector", "hmm_mos")
PRESETS = ("paper", "default")
SCENARIOS = tuple(name for name in ALL if name not in LONG)
SENSORS = ("HDL-64E", "OS1-128", "VLP-16")
FEW = ("city", "avenue", "hills")
DRIVE = "kitti_0005"
REAL = (DRIVE, "kitti_0027", "room_vlp16", "yard_avia", "handheld_xt32")
OF_DRIVE = (
    *("in time order", "cut every 1.09 turns", "cut every 0.92 turns", "cut every 1.09 turns, no stamps"),
    *("cut every 1.09 turns, relative times", "cut every 1.09 turns, shuffled", "every 7th scan lost, no stamps"),
    *("every 10th scan twice, no stamps", "renumbered, no stamps", "two scans merged", "beam by beam", "shuffled"),
)
"""Cases that the drive, a real recording of raw sweeps, is put through."""


def worlds(
    scenarios: Iterable[str], sensors: Iterable[str], scans: int, seeds: Iterable[int], case: str = ""
) -> tuple[str, ...]:
    """Return the names of simulated recordings."""
    kept = f"@{case}" if case else ""
    return tuple(f"{c}:{s}:{scans}:{seed}{kept}" for seed in seeds for c in scenarios for s in sensors)


@dataclass(frozen=True)
class Benchmark:
    """A list of experiments.

    Attributes
    ----------
    what : what it measures, for the docs.
    takes : how long about on two cores, whole.
    measure : see `Experiment`; or the name of a script of this folder, run with `options["arguments"]`.
    recordings, methods, changes : what is combined.
    sweep : further arguments, one set for each combination.
    quick : recordings of the short form.
    quick_sweep : the same of `sweep`; all, if there are none.
    leaves_out : what its seconds and megabytes do not count, beside what every experiment leaves out.
    is_timed : whether nothing else may run beside it.
    is_of_everything : whether its result is of the whole package.
    """

    what: str
    takes: str
    measure: str
    recordings: tuple[str, ...] = ("",)
    methods: tuple[str, ...] = ("",)
    changes: tuple[str, ...] = ("",)
    sweep: tuple[dict[str, Any], ...] = ({},)
    quick: tuple[str, ...] = ()
    quick_sweep: tuple[dict[str, Any], ...] = ()
    leaves_out: str = "warm-up on 12 scans"
    is_timed: bool = False
    is_of_everything: bool = False
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def varied(self) -> list[str]:
        """The further arguments that tell its experiments apart."""
        return [name for name in self.sweep[0] if len({str(given[name]) for given in self.sweep}) > 1]

    def experiments(self, **asked: Any) -> list[Experiment]:
        """Return the experiments, with other recordings, methods, changes or seeds where they are `asked` for."""
        is_quick = asked.get("quick", False)
        recordings = asked.get("recordings") or (self.quick if is_quick and self.quick else self.recordings)
        if asked.get("seeds"):
            recordings = list(dict.fromkeys(_seeded(name, seed) for seed in asked["seeds"] for name in recordings))
        sweep = self.quick_sweep if is_quick and self.quick_sweep else self.sweep
        axes = (recordings, asked.get("methods") or self.methods, asked.get("changes") or self.changes, sweep)
        return [
            Experiment(self.measure, recording, method, change, given, self.is_of_everything)
            for recording, change, method, given in product(axes[0], axes[2], axes[1], axes[3])
        ]


def _seeded(name: str, seed: int) -> str:
    base, at, case = name.partition("@")
    if base.count(":") != 3:
        return name
    return f"{base.rpartition(':')[0]}:{seed}{at}{case}"


_DANGERS = ("motorway", "canyon", "slowdown", "avenue")
_OTHERS = ("city", "junction", "campus", "avenue", "hills", "scooters")
_TRUST = (
    *worlds(SCENARIOS, ("VLP-16",), 60, (30,)),
    *(f"{name}:{SENSORS[k % 2]}:60:31" for k, name in enumerate(SCENARIOS)),
    *worlds(("canyon", "avenue", "motorway", "slowdown"), ("VLP-16",), 60, (32, 33)),
    *("junction:OS1-128:60:34@turns=1.09;order=time;stamps=false", "motorway:HDL-64E:60:34@turns=1.2;order=random"),
    *("slowdown:VLP-16:60:34@turns=0.92;order=random;times=constant", "city:OS1-128:60:35@every=5"),
    *("city:HDL-64E:60:34@reference=middle;reference_speed=0.7", "avenue:HDL-64E:60:34@leave_out=7;stamps=false"),
    *("hills:VLP-16:60:34@renumbered=true;stamps=false", "avenue:VLP-16:60:35@rain"),
)
"""Forty drives: all scenarios with few and with many beams, the treacherous ones twice more, odd recorders."""
_UNSEEN = tuple(f"{c}:{s}:{DOMAINS['S'].test.scans}:{seed}" for c, s, seed in DOMAINS["S"].test.worlds)
"""Worlds on which networks of domain S are scored."""
_SMALL = {"worlds": 1, "scans": 12, "epochs": 2, "samples": 8}
_MINUTES = worlds(("city", "campus"), ("VLP-16",), 1000, (100,))
"""Drives so long that a path has an end: what was seen minutes ago must neither be forgotten nor weigh ever more."""
_INSERTED = "kitti_0027_movers"
"""A drive with movers put in, an adult, a cyclist and a scooter, whose truth is exact; scored, not looked at."""


def _taught(seeds: Iterable[int], **size: int) -> tuple[dict[str, Any], ...]:
    given = {"tests": (DRIVE, _INSERTED), "sector": 128, **size}
    return tuple({"labels": labels, "seed": seed, **given} for seed in seeds for labels in ("true", "automatic"))


_RULES = ("", *(name for name in CHOICES if name not in (*OTHER_METHODS, "everything")))

BENCHMARKS = {
    "gate": Benchmark(
        "labels in twelve scenarios by three sensors, simulated",
        "20 min a seed",
        "labels:score",
        worlds(SCENARIOS, SENSORS, 60, (100,)),
        ("default",),
        quick=worlds(FEW, SENSORS, 60, (100,)),
    ),
    "objects": Benchmark(
        "one mover, one object: half a minute of lights, kerbs and groups on foot, simulated",
        "60 min",
        "bodies:score",
        worlds(LONG, ("OS1-64", "VLP-16"), 320, (210, 211)),
        ("default",),
        quick=worlds(LONG, ("OS1-64",), 320, (210,)),
        leaves_out="nothing",
    ),
    "calibration": Benchmark(
        "do as many bodies move as their probability says? sixty worlds",
        "30 min",
        "bodies:score",
        worlds(SCENARIOS, ("VLP-16",), 40, (200, 201, 202, 203, 204)),
        ("default",),
        quick=worlds(SCENARIOS, ("VLP-16",), 40, (200,)),
        leaves_out="nothing",
    ),
    "recordings": Benchmark(
        "labels of real recordings, as they are and as others would have kept them, and of drives of minutes",
        "25 min",
        "labels:score",
        ("city:HDL-64E:60:0", *_MINUTES, *REAL, *(f"{DRIVE}@{case}" for case in OF_DRIVE)),
        ("default",),
        quick=("city:HDL-64E:60:0", *REAL),
    ),
    "jitter": Benchmark(
        "how far labels hang on chance: stamps off by a tenth of a millisecond",
        "6 min a recording",
        "labels:score",
        tuple(f"{DRIVE}~{seed}" for seed in range(9)),
        ("default",),
        quick=tuple(f"{DRIVE}~{seed}" for seed in range(3)),
    ),
    "conventions": Benchmark(
        "what recorders' conventions, carriers and weather cost",
        "3 h",
        "labels:score",
        tuple(
            name
            for case in CASES
            for name in worlds(("city", "junction", "avenue", "campus"), SENSORS, 40, (17,), case)
        ),
        ("default",),
        quick=tuple(f"city:VLP-16:40:17@{case}" for case in CASES),
    ),
    "other-sensors": Benchmark(
        "labels with sensors that the gate does not have",
        "30 min",
        "labels:score",
        (
            *worlds(_OTHERS, ("HDL-32E", "OS1-64", "VLS-128", "Avia"), 40, (104, 105), "plain"),
            *worlds(_OTHERS, ("Avia",), 40, (104, 105), "relative times"),
        ),
        ("default",),
        quick=("city:Avia:40:104@plain",),
    ),
    "robustness": Benchmark(
        "labels of drive 0005 made worse",
        "5 min",
        "labels:score",
        tuple(f"{DRIVE}@{case}" for case in ALTERED),
        ("default",),
    ),
    "methods-drive": Benchmark(
        "presets and published methods on drive 0005, with seconds and memory",
        "2 h",
        "labels:compared",
        (DRIVE,),
        (*RIVALS, *PRESETS),
        sweep=({"repeats": 3},),
        quick_sweep=({"repeats": 2},),
        leaves_out="odometry, of rivals",
        is_timed=True,
    ),
    "methods-worlds": Benchmark(
        "presets and published methods on the gate's worlds with 64 beams",
        "3 h",
        "labels:compared",
        worlds(SCENARIOS, ("HDL-64E",), 60, (100,)),
        (*RIVALS, *PRESETS),
        quick=worlds(FEW, ("HDL-64E",), 60, (100,)),
    ),
    "rivals": Benchmark(
        "presets and rivals on real drives, and on one with inserted movers",
        "1 h a recording",
        "labels:compared",
        (DRIVE, "lyft_5hz", _INSERTED),
        (*RIVALS, *PRESETS),
    ),
    "semantickitti": Benchmark(
        "Table I of the paper, on SemanticKITTI",
        "days",
        "labels:compared",
        ("00", "01", "02", "03", "04", "05", "06", "07", "09", "10"),
        (*RIVALS, *PRESETS),
        quick=("04",),
    ),
    "ablation": Benchmark(
        "what each rule, setting or constant is worth, with 16 beams",
        "90 min",
        "labels:score",
        worlds(SCENARIOS, ("VLP-16",), 60, (100,)),
        ("default",),
        _RULES,
        quick=("city:VLP-16:60:100",),
    ),
    "odometry": Benchmark(
        "drift of the odometry, thickness of walls",
        "15 min",
        "poses:drift",
        ("kitti_0005", "kitti_0027", *worlds(("canyon", "motorway"), SENSORS, 100, (0,))),
        ("default",),
        quick=worlds(("canyon",), ("VLP-16",), 100, (0,)),
        leaves_out="nothing",
    ),
    "trust": Benchmark(
        "forty drives, good and bad: does a warning say so?",
        "20 min",
        "poses:speed",
        _TRUST,
        ("default",),
        quick=_TRUST[:3],
    ),
    "ablation-odometry": Benchmark(
        "what each part of the odometry is worth",
        "60 min",
        "poses:speed",
        worlds(_DANGERS, ("VLP-16", "HDL-64E"), 40, (110, 111)),
        ("default",),
        ("", *ODOMETRY),
        ({"missing": 0}, {"missing": 7}),
        quick=worlds(("canyon",), ("VLP-16",), 40, (110,)),
    ),
    "stages": Benchmark(
        "seconds a scan of every stage, peak memory",
        "5 min",
        "cost:stages",
        (DRIVE,),
        PRESETS,
        sweep=({"laps": 1}, {"laps": 3}),
        quick_sweep=({"laps": 1},),
        is_timed=True,
    ),
    "odometry-speed": Benchmark(
        "our odometry beside KISS-ICP's package",
        "1 min",
        "cost:odometry",
        (DRIVE,),
        ("kiss-icp", *PRESETS),
        is_timed=True,
    ),
    "online": Benchmark(
        "drive 0005 as scans come, by lag",
        "10 min",
        "online.py",
        options={"arguments": (DRIVE, "--rivals", "--lags", "0", "0.5"), "quick": ("--scans", "60")},
        leaves_out="the first 12 scans",
        is_timed=True,
    ),
    "lags": Benchmark(
        "lag against quality: recordings, worlds, first scans, departures",
        "3 h",
        "lags:score",
        (*REAL, "lyft_5hz", *worlds(SCENARIOS, ("VLP-16", "HDL-64E"), 60, (100,))),
        sweep=tuple({"lag": lag} for lag in (0.0, 0.2, 0.5, 1.0, 2.0, "all")),
        quick=(*REAL, "lyft_5hz", *worlds(FEW, ("VLP-16",), 60, (100,))),
        quick_sweep=tuple({"lag": lag} for lag in (0.0, 0.5, "all")),
    ),
    "table-2": Benchmark(
        "Table II: networks trained on automatic and on true labels",
        "4 h; minutes on a GPU",
        "networks:table",
        sweep=({"which": 2},),
        quick_sweep=({"which": 2, **_SMALL},),
        is_of_everything=True,
    ),
    "table-3": Benchmark(
        "Table III: another sensor and place, fine-tuning",
        "4 h; minutes on a GPU",
        "networks:table",
        sweep=({"which": 3},),
        quick_sweep=({"which": 3, **_SMALL},),
        is_of_everything=True,
    ),
    "labels-of-networks": Benchmark(
        "what a network learns from automatic labels and from true ones of the same scans, on real drives",
        "30 min",
        "networks:by_labels",
        ("lyft_5hz",),
        sweep=_taught(range(3), epochs=8, samples=300, packed=160, scans=20),
        quick_sweep=_taught(range(1), **{**_SMALL, "packed": 8}),
        is_of_everything=True,
    ),
    "shipped-network": Benchmark(
        "the network that comes along: a sensor, a place, a world that it has not seen",
        "5 min",
        "labels:by_network",
        (DRIVE, "lyft_5hz", "kitti_0027", "room_vlp16", "yard_avia", *_UNSEEN),
        quick=(DRIVE,),
        is_of_everything=True,
    ),
    "network-speed": Benchmark(
        "milliseconds a scan of every stage of the online network",
        "1 min",
        "cost:network",
        (DRIVE,),
        leaves_out="the first 12 scans",
        is_timed=True,
        is_of_everything=True,
    ),
    "fleet": Benchmark(
        "many recordings on processes and on Ray",
        "10 min",
        "cost:fleet",
        sweep=(
            {"what": "pool", "workers": 1, "recordings": 64},
            *({"what": "pool", "workers": 2, "recordings": n} for n in (64, 32, 16, 8)),
            {"what": "ray", "workers": 2, "recordings": 64},
        ),
        quick_sweep=({"what": "pool", "workers": 2, "recordings": 4, "scans": 12},),
        leaves_out="simulating the recordings",
        is_timed=True,
        is_of_everything=True,
    ),
}
