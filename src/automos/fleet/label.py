"""`automos label` over many recordings: from the user's input to labels, ledger and report."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from automos.core.errors import InputError
from automos.core.parallel import available_cores, checked_workers
from automos.core.workspace import RUN_FILE
from automos.fleet.fleet import Fleet, Outcome, Progress
from automos.fleet.ledger import Ledger, ledger_folder, ledger_name
from automos.fleet.local_pool import Executor, InProcess, LocalPool
from automos.fleet.orders import Job, Recording
from automos.fleet.sources import Shard
from automos.fleet.status import read_status
from automos.fleet.storage import is_url, join, key_of, shown
from automos.fleet.units import settings_key
from automos.fleet.work_folder import default_work, memory_bytes, work_folder
from automos.readers import open_sequence
from automos.results.claiming import refuse_scans
from automos.results.writing import versions
from automos.settings import Settings, dump_yaml

_GB = 10**9
MOST_GB = 1e6
"""More than any machine has."""
GivenPoses = tuple[Path | None, Path | None, bool]
"""Pose file and calibration of a run of one recording, and whether results with other poses are replaced."""


@dataclass(frozen=True)
class Resources:
    """What a run may use; none of it shapes a label.

    Attributes
    ----------
    workers : int
        Processes on this machine; 0: one per core, if each then has `memory_gb`.
    ray : str, optional
        Address of a cluster to use instead of this machine.
    memory_gb : float
        Memory that a worker needs.
    cache_gb : float
        Most that copies of recordings in stores may take on a machine's disk.
    work : Path
        Folder for these, and for results on their way to a store.
    chunk : int
        Scans per unit of work.
    """

    workers: int = 0
    ray: str | None = None
    memory_gb: float = 3.0
    cache_gb: float = 50.0
    work: Path = field(default_factory=default_work)
    chunk: int = 600

    def __post_init__(self) -> None:
        checked_workers(self.workers)
        for option, gigabytes in (("--memory", self.memory_gb), ("--cache", self.cache_gb)):
            if not 0.0 <= gigabytes <= MOST_GB:
                raise InputError(f"{option} is {gigabytes:g} GB: give a number up to {MOST_GB:g}")


def label_fleet(
    recordings: list[Recording],
    target: str,
    settings: Settings,
    resources: Resources,
    shard: Shard | None = None,
    poses: GivenPoses = (None, None, False),
    progress: Progress | None = None,
    executor: Callable[[Resources], Executor] | None = None,
) -> Outcome:
    """Label `recordings` into folders of their names below `target`, a path or URL; what is there already stays.

    Parameters
    ----------
    shard : tuple[int, int], optional
        Which part of a run this process does, where `recordings` are a part.
    poses : tuple[Path, Path, bool], optional
        Those to use instead of odometry.
    executor : callable, optional
        Makes what does the work; by `resources` where not given.

    Raises
    ------
    InputError
        `target` holds results made with other settings, lies in a recording, or cannot be written.
    """
    if not is_url(target):
        target = str(Path(target).absolute())  # workers may stand elsewhere
    _refuse_places_in_recordings(recordings, target)
    key = settings_key(settings)
    _refuse_other_settings(target, key)
    name = ledger_name(shard)
    books = join(ledger_folder(target), name)
    path = resources.work / "ledgers" / key_of(target) / name if is_url(target) else Path(books)
    is_needed = is_url(target) or any(is_url(recording.source) for recording in recordings)
    pose_file, calib_file = (None if file is None else file.absolute() for file in poses[:2])
    work, cache_bytes = resources.work.absolute(), int(resources.cache_gb * _GB)
    job = Job(settings, target, work, cache_bytes, resources.chunk, pose_file, calib_file, poses[2])
    with (
        (executor or make_executor)(resources) as workers,
        work_folder(resources.work, is_needed),
        closing(Ledger(path, books if is_url(target) else None)) as ledger,
    ):
        ledger.begin(recordings, key, dump_yaml(settings), versions(), workers.slots)
        return Fleet(recordings, job, workers, ledger).run(progress)


def make_executor(resources: Resources) -> Executor:
    """Return what does the work: a named cluster, else as many cores of this machine as have memory enough."""
    if resources.ray is not None:
        from automos.fleet.ray_cluster import RayCluster

        return RayCluster(resources.ray, int(resources.memory_gb * _GB))
    cores = resources.workers or available_cores()
    fitting = max(1, int(memory_bytes() / (resources.memory_gb * _GB))) if memory_bytes() else cores
    workers = resources.workers or min(cores, fitting)
    return InProcess() if workers == 1 else LocalPool(workers, cores)


def has_one_process_enough(recordings: list[Recording], target: str, resources: Resources) -> bool:
    """Return whether there is one recording, on this machine's disk and short: its stages then use all cores."""
    if len(recordings) != 1 or resources.ray is not None or is_url(target) or is_url(recordings[0].source):
        return False
    return (
        resources.workers == 1 or len(open_sequence(recordings[0].source, recordings[0].format)) <= 2 * resources.chunk
    )


def closing_lines(outcome: Outcome, target: str) -> list[str]:
    """Return what was done, and what was not and why, for a terminal."""
    had_been = f" ({len(outcome.had_been)} had been before)" if outcome.had_been else ""
    where, n = shown(target), outcome.n_labelled
    n_ended = n + len(outcome.failed)
    lines = [f"{n} of {n_ended} recordings labelled{had_been}, {outcome.scans:,} scans; in {where}"]
    if outcome.warned:
        lines.append(f"{len(outcome.warned)} of them with warnings; read them: automos status {where}")
    lines += [f"not labelled: {name}: {reason}" for name, reason in sorted(outcome.failed.items())]
    return lines


def _refuse_places_in_recordings(recordings: list[Recording], target: str) -> None:
    """Raise where labels would become files of a recording: in a store it would never be the same one again."""
    if not is_url(target):
        refuse_scans(Path(target))
        if (Path(target) / RUN_FILE).exists() and any(recording.folder != "" for recording in recordings):
            raise InputError(
                f"{target} holds the results of one recording, and those of others would lie in folders among them: "
                "choose another --out"
            )
    for recording in recordings:
        place, source = shown(recording.target(target)), shown(recording.source).rstrip("/")
        if is_url(place) and f"{place}/".startswith(f"{source}/"):
            raise InputError(
                f"{place} lies in the recording {source}, of which labels must not be a part: choose another --out"
            )


def _refuse_other_settings(target: str, key: str) -> None:
    try:
        runs = read_status(target).runs
    except InputError:
        return  # there is no run yet
    if any(run["settings_key"] not in (None, key) for run in runs):
        raise InputError(
            f"{shown(target)} holds a run with other settings, or of another version of automos: choose another --out, "
            "so that results of both are not mixed"
        )
