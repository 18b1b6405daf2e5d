"""What `all.py` runs: one script of this folder each, with fixed arguments, whole or in a short form."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Job:
    """One script with fixed arguments; `DRIVE_0005`, `STORE` and `CACHE` in them are replaced.

    Attributes
    ----------
    name, script, arguments : the whole of it.
    quick : arguments of a short form, which `--quick` runs instead.
    rooms : the parts of the package that its result is of, all where none are named.
    """

    name: str
    script: str
    arguments: tuple[str, ...]
    quick: tuple[str, ...]
    rooms: tuple[str, ...] = ()

    @property
    def needs_drive(self) -> bool:
        return "DRIVE_0005" in self.arguments

    def command(self, is_quick: bool) -> str:
        return f"python benchmarks/{self.script} {' '.join(self.quick if is_quick else self.arguments)}"


RIVALS = ("octomap", "removert", "erasor", "pfreundschuh", "yoon", "dufomap", "m_detector", "hmm_mos")
PRESETS = ("paper", "default")
RIVAL_ROOMS = (
    *("baselines/", "evaluation/", "candidates/ground", "paper/erasor", "paper/region_ground"),
    *("paper/submaps", "paper/voxels", "voxel_map", "candidates/free_space_pattern"),
)
"""What the other methods are made of. The poses that they are given are those of `default` when they were run."""

_DRIVE = ("DRIVE_0005", "--scenarios", "none", "--cache", "CACHE/table1")
_WORLDS = ("--store", "STORE", "--seed", "100", "--scans", "60", "--cache", "CACHE/table1")
_FEW_WORLDS = ("--scenarios", "city", "avenue", "hills")
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
            )
            for rival in RIVALS
        ),
        Job(
            "presets",
            "table1.py",
            (*_DRIVE, "--repeat", "3", "--methods", *PRESETS),
            (*_DRIVE, "--methods", *PRESETS),
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
        Job("speed", "speed.py", ("DRIVE_0005", "--repeat", "3"), ("DRIVE_0005",)),
        Job(
            "speed-paper",
            "speed.py",
            ("DRIVE_0005", "--repeat", "3", "--preset", "paper"),
            ("DRIVE_0005", "--preset", "paper"),
        ),
        Job("robustness", "robustness.py", ("DRIVE_0005",), ("DRIVE_0005", "--scans", "60")),
        Job("ablation", "ablation.py", ("DRIVE_0005",), ("DRIVE_0005", "--scans", "60")),
        Job(
            "suite",
            "suite.py",
            ("--seed", "60", "--scans", "60", "--cache", "CACHE/suite"),
            ("--seed", "60", "--cache", "CACHE/suite", *_FEW),
        ),
    )
}
"""Seed 60 of the simulator and the gate's seed 100 are for these tables: nothing was chosen on them."""
