"""What `all.py` runs: one script of this folder each, with fixed arguments, whole or in a short form."""

from __future__ import annotations

from job import Job
from jobs_beside_labels import JOBS_BESIDE_LABELS

RIVALS = ("octomap", "removert", "erasor", "pfreundschuh", "yoon", "dufomap", "m_detector", "hmm_mos")
PRESETS = ("paper", "default")
RIVAL_ROOMS = (
    *("baselines/", "evaluation/", "ground/surface", "paper/erasor", "paper/region_ground"),
    *("paper/submaps", "paper/voxels", "voxels", "sensor/beam_pattern", "sensor/directions"),
)
"""What the other methods are made of. The poses that they are given are those of `default` when they were run."""

_DRIVE = ("DRIVE_0005", "--scenarios", "none", "--cache", "CACHE/table1")
_WORLDS = ("--store", "STORE", "--seed", "100", "--scans", "60", "--cache", "CACHE/table1")
_FEW_WORLDS = ("--scenarios", "city", "avenue", "hills")
_STORE = ("--store", "STORE")
_GATE = (*_STORE, "--seeds", "100")
_FEW_CHOICES = ("everything", "evidence of 1 s only", "where it went does not count")
_UNCERTAIN_CHOICES = (
    *("numbers of points do not choose", "evidence does not choose", "what has stayed is forgotten"),
    "a lost mover may pass its length in a second",
)
_RECORDERS = (
    *("DRIVE_0005@cut every 1.09 turns", "DRIVE_0005@cut every 1.09 turns, shuffled"),
    *("DRIVE_0005@cut every 0.92 turns", "city:VLP-16:40:101@dust", "junction:HDL-64E:40:101@dust"),
)
_OF_RECORDERS = (
    *("everything", "clouds are objects", "mixed segments stay whole", "what was lost may have stayed"),
    *("a lost mover may pass its length in a second", "what has stayed is forgotten"),
)
_HILLS = tuple(f"hills:{sensor}:60:{seed}" for seed in (101, 102, 103) for sensor in ("HDL-64E", "OS1-128", "VLP-16"))
_OF_HILLS = (*_STORE, "--choices", "everything", "the walk on the ground begins level")
_BODIES = (
    *("campus:HDL-64E:40:107@boat", "campus:VLP-16:40:107@truck", "city:OS1-128:40:107@truck"),
    *("junction:HDL-64E:40:107@backpack", "campus:HDL-64E:40:107@1 % specks in the air"),
    *("campus:OS1-128:40:107@plain", "city:VLP-16:40:107@three LiDARs"),
    *("city:HDL-64E:40:106@boat", "city:HDL-64E:40:108@boat", "slowdown:VLP-16:40:106@truck"),
    *("campus:HDL-64E:40:106@1 % specks in the air", "campus:HDL-64E:40:108@1 % specks in the air"),
)
_OF_BODIES = (
    *("everything", "what rides along is an object", "nothing is connected to the body"),
    *("all that is connected is body", "all that keeps its range is body", "edges of the body may move"),
    *("grazed faces keep their range", "within arm's reach all may be objects"),
)
_ONLINE = ("DRIVE_0005", "--rivals")
_FEW = ("--scenarios", "city", "junction", "campus", "waiting", "country", "--scans", "30")

JOBS = {
    job.name: job
    for job in (
        *(
            Job(
                f"drive-{rival}",
                "table1.py",
                (*_DRIVE, "--repeat", "3", "--methods", rival),
                (*_DRIVE, "--methods", rival),
                RIVAL_ROOMS,
                is_timed=True,
            )
            for rival in RIVALS
        ),
        Job(
            "presets",
            "table1.py",
            (*_DRIVE, "--repeat", "3", "--methods", *PRESETS),
            (*_DRIVE, "--methods", *PRESETS),
            is_timed=True,
        ),
        *(
            Job(
                f"worlds-{rival}",
                "table1.py",
                (*_WORLDS, "--methods", rival),
                (*_WORLDS, *_FEW_WORLDS, "--methods", rival),
                RIVAL_ROOMS,
            )
            for rival in RIVALS
        ),
        Job(
            "worlds-presets",
            "table1.py",
            (*_WORLDS, "--methods", *PRESETS),
            (*_WORLDS, *_FEW_WORLDS, "--methods", *PRESETS),
        ),
        Job("speed", "speed.py", ("DRIVE_0005", "--repeat", "3"), ("DRIVE_0005",), is_timed=True),
        Job(
            "speed-paper",
            "speed.py",
            ("DRIVE_0005", "--repeat", "3", "--preset", "paper"),
            ("DRIVE_0005", "--preset", "paper"),
            is_timed=True,
        ),
        Job("robustness", "robustness.py", ("DRIVE_0005",), ("DRIVE_0005", "--scans", "60")),
        Job("ablation", "ablation.py", ("DRIVE_0005",), ("DRIVE_0005", "--scans", "60")),
        Job(
            "suite",
            "suite.py",
            ("--seed", "60", "--scans", "60", "--cache", "CACHE/suite"),
            ("--seed", "60", "--cache", "CACHE/suite", *_FEW),
        ),
        Job("gate", "gate.py", (*_GATE, "--parts", "worlds"), (*_GATE, "--parts", "worlds", *_FEW_WORLDS)),
        Job(
            "gate-recordings",
            "gate.py",
            (*_GATE, "--parts", "tutorial", "real", "conventions"),
            (*_GATE, "--parts", "tutorial", "real"),
            needs_recordings=True,
        ),
        Job(
            "conventions",
            "conventions.py",
            _STORE,
            (*_STORE, "--scenarios", "city", "junction"),
        ),
        Job(
            "point-times",
            "point_times.py",
            (),
            ("--sensors", "VLP-16", "--conventions", "plain", "shuffled", "cut every 1.09 turns"),
            ("odometry/", "sensor/", "settings/odometry", "voxels"),
            is_timed=True,
        ),
        Job("trust", "trust.py", (*_STORE, "--seed", "30"), (*_STORE, "--seed", "30", "--only", "VLP-16")),
        Job(
            "ablation-gate",
            "ablation.py",
            (*_STORE, "--gate", "100", "--sensors", "VLP-16"),
            (*_STORE, "--gate", "100", "--sensors", "VLP-16", "--choices", *_FEW_CHOICES),
        ),
        Job(
            "ablation-sensors",
            "ablation.py",
            (*_STORE, "--gate", "106", "--choices", *_UNCERTAIN_CHOICES),
            (*_STORE, "--gate", "106", "--choices", *_UNCERTAIN_CHOICES[:2]),
        ),
        Job(
            "ablation-recorders",
            "ablation.py",
            (*_RECORDERS, "--choices", *_OF_RECORDERS),
            (*_RECORDERS[2:4], "--choices", *_OF_RECORDERS),
        ),
        Job(
            "ablation-bodies",
            "ablation.py",
            (*_BODIES, "--choices", *_OF_BODIES),
            (*_BODIES[:2], "--choices", *_OF_BODIES),
        ),
        Job("ablation-hills", "ablation.py", (*_HILLS, *_OF_HILLS), (*_HILLS[:3], *_OF_HILLS)),
        Job(
            "ablation-odometry",
            "ablation_odometry.py",
            _STORE,
            (*_STORE, "--seeds", "110"),
            ("odometry/", "settings/odometry", "voxels"),
        ),
        Job(
            "short-recordings",
            "short_recordings.py",
            (),
            ("--scenarios", "city"),
            ("odometry/", "settings/odometry", "voxels"),
            needs_recordings=True,
        ),
        Job("other-sensors", "other_sensors.py", (), ("--sensors", "Avia", "--scenarios", "city", "--seeds", "104")),
        Job("simulator-odometry", "simulator_odometry.py", (), ("--scenarios", "city", "canyon")),
        Job(
            "online",
            "online.py",
            (*_ONLINE, "--lags", "0", "0.5"),
            (*_ONLINE, "--lags", "0", "--scans", "60"),
            is_timed=True,
        ),
        Job(
            "online-suite",
            "online_suite.py",
            (*_STORE, "--seeds", "100"),
            (*_STORE, "--seeds", "100", *_FEW_WORLDS, "--sensors", "VLP-16"),
        ),
        Job(
            "odometry",
            "odometry.py",
            ("--cache", "CACHE/odometry"),
            ("--cache", "CACHE/odometry", "--worlds", "canyon", "--sensors", "VLP-16"),
            needs_recordings=True,
        ),
        *JOBS_BESIDE_LABELS,
    )
}
"""Seed 60 of the simulator, the gate's seed 100, seeds 104 to 108 and 110 to 112, seed 30 of `trust.py` and 31 of
`short_recordings.py` are for these tables: no choice was made on them. Choices were made on seed 17 of
`conventions.py`, and on drive 0005. Networks have the seeds of `automos.network.domains`; what scores no labels (the
simulator's statistics, reference poses) takes seeds 0 to 3."""
