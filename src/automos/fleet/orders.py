"""What is asked of a worker and what it answers: a recording, a part of the work on it, and how that ended.

Whatever else changes (where workers run, where recordings lie, what fails), these few plain values are all that goes
from the one who deals out the work to those who do it, and back.
"""

from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from automos.fleet.storage import join
from automos.settings import Settings


@dataclass(frozen=True)
class Recording:
    """One recording of a run.

    Attributes
    ----------
    name : str
        Unique in the run.
    source : str
        A path or URL that `automos label` takes.
    format : str, optional
        The recording's format, if it is not recognised.
    folder : str, optional
        Its results' place below the run's folder; its name where not given.
    """

    name: str
    source: str
    format: str | None = None
    folder: str | None = None

    def target(self, run: str) -> str:
        """Return the path or URL of its results, in the run at path or URL `run`."""
        return join(run, self.name if self.folder is None else self.folder)


class Kind(Enum):
    """The parts in which a recording is worked on, in their order; a short one is done whole, by the first."""

    START = "start"
    EVIDENCE = "evidence"
    TRACKS = "tracks"
    LABELS = "labels"
    RESULTS = "results"


@dataclass(frozen=True)
class Unit:
    """A part of the work on a recording: a kind, and the scans [first, last) where it is for some of them only."""

    kind: Kind = Kind.START
    first: int = 0
    last: int = 0

    def __str__(self) -> str:
        return f"{self.kind.value} {self.first}:{self.last}" if self.last else self.kind.value


@dataclass(frozen=True)
class Job:
    """The common part of all orders of a run.

    Attributes
    ----------
    settings : Settings
        What shapes the labels.
    target : str
        Path or URL of the results, with a folder for each recording, named after it.
    work : Path
        Folder on the worker's own disk: results on their way to a bucket, copies of recordings from one.
    cache_bytes : int
        Most that copies of recordings may take there.
    chunk : int
        Scans per unit; recordings of more than two of these are cut.
    pose_file, calib_file : Path, optional
        Poses to use instead of odometry, of a run of one recording.
    overwrite : bool
        Replace results that were made with other poses.
    """

    settings: Settings
    target: str
    work: Path
    cache_bytes: int = 50 * 10**9
    chunk: int = 600
    pose_file: Path | None = None
    calib_file: Path | None = None
    overwrite: bool = False


@dataclass(frozen=True)
class Order:
    """One unit of one recording, to be done with `threads`.

    `home`, where given, is the place that holds what earlier units found: this unit can be done nowhere else.
    """

    job: Job
    recording: Recording
    unit: Unit = field(default_factory=Unit)
    threads: int = 1
    home: str | None = None


class State(Enum):
    """How a unit ended: done; too long, to be cut; failed for good; failed in a way that may pass."""

    DONE = "done"
    CUT = "cut"
    FAILED = "failed"
    AGAIN = "again"


@dataclass(frozen=True)
class Report:
    """The outcome of a unit.

    Attributes
    ----------
    reason : str
        A sentence, if it failed.
    trace : str
        Traceback, if the reason is not a sentence for users.
    scans, points, moving : int
        Counts of the recording, once its labels are there.
    fingerprint : str
        Of the labels.
    warnings : list of str
        Sentences about them.
    is_fresh : bool
        False if the labels existed already.
    seconds, cpu_seconds : float
        Of this unit.
    peak_mb : float
        Peak memory of its process.
    place : str
        Where it was done.
    """

    state: State
    reason: str = ""
    trace: str = ""
    scans: int = 0
    points: int = 0
    moving: int = 0
    fingerprint: str = ""
    warnings: tuple[str, ...] = ()
    is_fresh: bool = True
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    peak_mb: float = 0.0
    place: str = ""


@dataclass(frozen=True)
class Ended:
    """An order that is no longer worked on: with a report, or lost with its worker, in a sentence."""

    order: Order
    report: Report | None
    loss: str = ""
