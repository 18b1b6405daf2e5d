"""Scene flow of a run: the motion of each point until the next scan, on its own and as seen by the moving sensor.

A point moves with its track; all others are static. The apparent motion by the sensor follows from the poses.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import inverse, transform
from automos.core.labels import Label
from automos.core.scan import Pose, Sequence
from automos.evaluation.flow import DYNAMIC, FlowCounts, evaluate_flow
from automos.results.run_files import RunFiles

Motion = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class ScanFlow:
    """The flow of one scan's points to the next scan.

    Attributes
    ----------
    points : (N, 3) metres, as seen from the scan's pose (motion during the sweep taken out).
    own : (N, 3) metres that each point itself moves, sensor frame of this scan.
    T_next_this : (4, 4) from this scan's sensor frame to the next one's.
    is_dynamic : (N,) whether a point moves faster than a crawl.
    is_known : (N,) False for points without a label, and for moving ones on no track.
    instances : (N,) track ids, 0 for none.
    """

    points: npt.NDArray[np.float32]
    own: Motion
    T_next_this: Pose
    is_dynamic: npt.NDArray[np.bool_]
    is_known: npt.NDArray[np.bool_]
    instances: npt.NDArray[np.int64]

    @property
    def flow(self) -> Motion:
        """(N, 3) metres from each point to its place in the next scan's sensor frame."""
        return (transform(self.T_next_this, self.points + self.own) - self.points).astype(np.float32)


def scan_flow(run: RunFiles, index: int) -> ScanFlow:
    """Return the flow of scan `index`, which must not be the last, to the next one."""
    scan = run.scan(index)
    labels, instances = run.labels(index, len(scan)), run.instances(index, len(scan))
    found = run.boxes_level(index)
    seconds = float(run.stamps[index + 1] - run.stamps[index])
    step = np.zeros((max(int(found.ids.max(initial=0)), int(instances.max(initial=0))) + 1, 3))
    has_track = np.zeros(len(step), bool)
    # Velocities are level; those of rows are turned by the transposed rotation on their right.
    step[found.ids] = seconds * found.velocity @ run.T_level_sensor(index)[:3, :3]
    has_track[found.ids] = True
    is_moving = labels == Label.MOVING
    own = np.where(is_moving[:, None], step[instances], 0.0).astype(np.float32)
    return ScanFlow(
        points=run.points_at_pose(scan, index),
        own=own,
        T_next_this=inverse(run.T_world_sensor[index + 1]) @ run.T_world_sensor[index],
        is_dynamic=np.linalg.norm(own, axis=1) >= DYNAMIC * seconds,
        is_known=scan.is_valid & (labels != Label.UNLABELED) & (~is_moving | has_track[instances]),
        instances=instances,
    )


def score_flow(results: Path, sequences: Iterable[Sequence]) -> FlowCounts | None:
    """Return how far off the flow in a results folder is; None without truth of motion, or where labels are all it is.

    Parameters
    ----------
    results : as `evaluate_recordings` takes it.
    """
    sequences = list(sequences)
    total = None
    for sequence in sequences:
        if all(sequence.truth_motion(i) is None for i in range(len(sequence) - 1)):
            continue
        folder = results if len(sequences) == 1 else results / sequence.name
        if not (folder / "tracks.json").exists() or not (folder / "poses.txt").exists():
            continue
        run = RunFiles(folder, sequence)
        try:
            counts = evaluate_flow(sequence, lambda i, run=run: scan_flow(run, i).own)  # type: ignore[misc]
        except InputError:
            continue  # labels without instances, of a run whose stages are gone
        total = counts if total is None else total + counts
    return total


def timestamps(run: RunFiles) -> list[str]:
    """Return the scans' times in nanoseconds, as texts: their own names where those are, else rounded to 1 us.

    Of sixteen digits, names may count microseconds (Waymo's do); the scans' stamps show it.
    """
    if all(name.isdecimal() and len(name) >= 16 for name in run.names):
        counts = np.array([float(name) for name in run.names])
        if not np.allclose(1e-6 * counts, run.stamps, rtol=0.0, atol=1e-3):
            return list(run.names)
    micro = np.round(1e6 * (run.stamps - min(0.0, float(run.stamps[0])))).astype(np.int64)
    return [str(1000 * int(value)) for value in micro]
