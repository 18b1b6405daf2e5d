"""What a worker does with an order: one unit of one recording, from wherever it lies to wherever results belong.

Poses and tracks belong to a recording as a whole. What lies between them asks of each scan only its points, the poses,
and scans some seconds away, and is the same whichever process does it; so that is what long recordings are cut for.
All units of a recording fill the same workspace, and the last one is the plain labelling of a recording, which finds
everything made: a recording that was cut has the same results, byte for byte, as one that was not.
"""

import shutil
import time
import traceback
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from automos import __version__
from automos.core.errors import AutomosError
from automos.core.scan import Sequence
from automos.core.stages import fingerprint
from automos.core.workspace import Workspace
from automos.fleet.cache import Cache
from automos.fleet.orders import Job, Kind, Order, Recording, Report, State
from automos.fleet.publishing import Marker, publish, read_marker, require_ours, withdraw
from automos.fleet.storage import StoreError, is_url, key_of
from automos.fleet.work_folder import claim, cpu_seconds, peak_megabytes, place
from automos.labeling import given_poses, label_recording, require_same_poses
from automos.pipeline import Steps
from automos.readers import open_sequence
from automos.results.run_warnings import sentences_of
from automos.settings import Settings

CUTTABLE = {"free_space", "erasor"}
"""Ways to find candidates that look no further than some seconds or metres; others need the recording as a whole."""


def work(order: Order) -> Report:
    """Do one unit; errors are in the report."""
    start, cpu = time.perf_counter(), cpu_seconds()
    cache = Cache(order.job.work / "recordings", order.job.cache_bytes)
    try:
        report = _do(order, cache)
    except StoreError as error:
        report = Report(State.AGAIN, str(error))
    except AutomosError as error:
        report = Report(State.FAILED, str(error))
    except OSError as error:
        report = Report(State.AGAIN, f"{error}; when that is put right, run the same command again", _trace())
    except Exception as error:
        message = f"{type(error).__name__}: {error}"
        report = Report(State.FAILED, f"{message}; this is a bug of automos, its place is in the ledger", _trace())
    seconds, cpu = time.perf_counter() - start, cpu_seconds() - cpu
    return replace(report, seconds=seconds, cpu_seconds=cpu, peak_mb=peak_megabytes(), place=place())


def settings_key(settings: Settings) -> str:
    """Return a fingerprint of the version and of all that shapes results beside the recording."""
    return fingerprint(__version__, settings.model_dump(mode="json"))


def results_folder(job: Job, recording: Recording) -> Path:
    """Return where a worker writes: the results' own place, or one on its disk where that is in a bucket."""
    if not is_url(job.target):
        return Path(recording.target(job.target))
    return Path(recording.target(str(job.work / "results" / key_of(job.target))))


def _do(order: Order, cache: Cache) -> Report:
    job, recording = order.job, order.recording
    if is_url(recording.source) or is_url(job.target):
        claim(job.work)
    stamp = cache.stamp_of(recording.source) if is_url(recording.source) else None
    marked = _finished(job, recording, stamp) if order.unit.kind is Kind.START else None
    if marked is not None and stamp is not None:  # known without fetching it
        return _report_of(marked, is_fresh=False)
    at_hand = cache.copy_of(recording.source) if is_url(recording.source) else nullcontext(recording.source)
    with at_hand as path:
        sequence = open_sequence(path, recording.format)
        stamp = stamp or sequence.fingerprint()
        if marked is not None and marked.source == stamp:
            return _report_of(marked, is_fresh=False)
        is_whole = order.unit.kind is Kind.RESULTS
        if order.unit.kind is Kind.START:
            require_ours(recording.target(job.target))
            poses = given_poses(sequence, job.pose_file, job.calib_file)
            require_same_poses(results_folder(job, recording), poses, job.overwrite)
            withdraw(recording.target(job.target))
            is_whole = len(sequence) <= 2 * job.chunk or job.settings.candidates.method not in CUTTABLE
        return _finish(order, sequence, stamp) if is_whole else _part(order, sequence)


def _finished(job: Job, recording: Recording, stamp: str | None) -> Marker | None:
    """Return the marker of results that are there already, made with these settings (and of this source, if known)."""
    marked = read_marker(recording.target(job.target))
    if marked is None or job.pose_file is not None or marked.settings != _made_with(job):
        return None
    if not is_url(job.target):
        run = Workspace(results_folder(job, recording)).read_run()
        if run.get("fingerprint") != marked.fingerprint:  # it was labelled again with other settings
            return None
    return marked if stamp is None or marked.source == stamp else None


def _made_with(job: Job) -> str:
    """Return what the marker says of the settings: others where poses were given, which runs without do not want."""
    key = settings_key(job.settings)
    return key if job.pose_file is None else fingerprint(key, "given poses")


def _part(order: Order, sequence: Sequence) -> Report:
    """Run the stages of one unit of a cut recording."""
    job, unit = order.job, order.unit
    poses = given_poses(sequence, job.pose_file, job.calib_file)
    folder = Workspace(results_folder(job, order.recording))
    steps = Steps(sequence, job.settings, poses, folder, order.threads)
    if unit.kind is Kind.START:
        _ = steps.trajectory
        return Report(State.CUT, scans=len(sequence))
    if unit.kind is Kind.EVIDENCE:
        steps.instances(range(unit.first, unit.last))
    elif unit.kind is Kind.TRACKS:
        _ = steps.objects
    else:
        steps.labels(range(unit.first, unit.last))
    return Report(State.DONE, scans=len(sequence))


def _finish(order: Order, sequence: Sequence, stamp: str) -> Report:
    """Label what is not labelled yet, write the results, and publish them."""
    job, recording = order.job, order.recording
    folder = results_folder(job, recording)
    how = (job.settings, job.pose_file, job.calib_file, order.threads)
    run = label_recording(sequence, folder, *how, waits=True, overwrite=job.overwrite)
    scans, points = run["recording"]["scans"], run["points"]
    counts = {"scans": scans, "points": sum(points.values()), "moving": points["moving"]}
    marker = Marker(stamp, _made_with(job), run["fingerprint"], counts, tuple(sentences_of(run)))
    publish(folder, recording.target(job.target), marker, recording.source)
    if is_url(job.target):
        shutil.rmtree(folder, ignore_errors=True)
    return _report_of(marker, is_fresh=True)


def _report_of(marker: Marker, is_fresh: bool) -> Report:
    counts: dict[str, Any] = dict(marker.counts)
    return Report(
        State.DONE, fingerprint=marker.fingerprint, warnings=tuple(marker.warnings), is_fresh=is_fresh, **counts
    )


def _trace() -> str:
    return traceback.format_exc(limit=-6)
