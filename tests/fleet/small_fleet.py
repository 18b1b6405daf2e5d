"""A fleet of recordings so small that thirty are labelled in seconds, and what their runs leave."""

from dataclasses import dataclass
from pathlib import Path

from worlds import ROADSIDE, drive, record, rider, write_bins

from automos.settings import Settings

N_SCANS = 12


@dataclass(frozen=True)
class Fleet:
    """A folder of recordings, the settings they are labelled with, and all result files that must be the same."""

    folder: Path
    settings: Settings
    expected: dict[str, dict[str, bytes]]

    @property
    def names(self) -> list[str]:
        return list(self.expected)

    def differences(self, results: Path) -> list[str]:
        """Return names of recordings whose results in folder `results` are not those of a plain run, byte for byte."""
        return [name for name in self.names if result_files(results / name) != self.expected[name]]


def result_files(folder: Path) -> dict[str, bytes]:
    """Return what a run leaves, but for what tells of time and place."""
    labels = [*folder.glob("predictions/*"), *folder.glob("confidences/*")]
    kept = [*labels, *(folder / name for name in ("poses.txt", "poses.tum", "tracks.json"))]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in kept if path.exists()}


def write_recording(folder: Path, seed: int, n_scans: int = N_SCANS) -> Path:
    """Write a street with two cyclists, each seed another: houses hold the path, so the odometry has no doubts."""
    riders = (rider(-3.0 + 0.2 * seed, 5.0, speed=5.0), rider(6.0, -3.0, yaw=1.6, speed=4.0 + 0.1 * seed))
    world = record((*ROADSIDE, *riders), drive(n_scans), n_beams=16, seed=seed)
    return write_bins(world.sequence, folder)
