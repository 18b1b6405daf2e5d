"""`automos segment`: one recording through the online network, labels out as `automos label` writes them."""

from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from automos import __version__
from automos.core.atomic import write_npy, write_text
from automos.core.pose_writers import write_kitti
from automos.core.run import Progress, silent
from automos.core.scan import Sequence
from automos.core.workspace import write_run
from automos.live.segment import stamped
from automos.network.deployed import Deployed, load_network
from automos.network.online import STAGES, OnlineSegmenter
from automos.results.claiming import claimed
from automos.results.point_files import count_points, no_points, write_points
from automos.results.writing import about
from automos.settings import Settings, dump_yaml


def shipped(suffix: str) -> Path:
    """Return the network that comes with the package: ".onnx" to run, ".pt" to fine-tune."""
    return Path(str(files("automos.network"))) / f"lmnet{suffix}"


def open_network(weights: Path | None, engine: str = "auto", device: str = "auto", threads: int = 0) -> Deployed:
    """Return the network in `weights`, the one that comes with the package where none is given; see `load_network`."""
    return load_network(weights or shipped(".onnx"), engine, device, threads)


def segment_recording(
    sequence: Sequence,
    folder: Path,
    network: Deployed,
    settings: Settings,
    probabilities: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Label every scan of `sequence` from itself and the ones before; write labels, poses and run.json to `folder`.

    Parameters
    ----------
    probabilities : bool
        Also write probabilities/*.npy, (N,) float16 per scan, that each point moves.

    Raises
    ------
    InputError
        The folder holds another program's labels, or cannot be written.
    """
    with claimed(folder, ["predictions", *(["probabilities"] if probabilities else [])], sequence):
        segmenter = OnlineSegmenter(network, settings, is_compensated=sequence.is_compensated)
        counts, poses = no_points(), []
        for i, (name, scan) in enumerate(zip(sequence.names, stamped(sequence), strict=True)):
            labels, moving = segmenter.segment(scan)
            poses.append(segmenter.T_world_sensor)
            write_points(folder, name, labels, None, None)
            if probabilities:
                write_npy(folder / "probabilities" / f"{name}.npy", moving.astype(np.float16))
            count_points(counts, labels)
            progress("segment", i + 1, len(sequence))
        write_kitti(folder / "poses.txt", np.array(poses))
        write_text(folder / "settings.yaml", dump_yaml(settings))
        run = {
            "recording": about(sequence),
            "network": {"engine": network.engine, "image": network.image.model_dump(mode="json"), "card": network.card},
            "points": counts,
            "milliseconds": latencies(segmenter),
            "versions": {"automos": __version__},
        }
        write_run(folder, run)
        return run


def latencies(segmenter: OnlineSegmenter) -> dict[str, dict[str, float]]:
    """Return median and 99th percentile in milliseconds of every stage and of all together."""
    seconds = {stage: np.array(segmenter.seconds[stage]) for stage in STAGES}
    n = min(len(values) for values in seconds.values())
    seconds["all"] = np.sum([values[len(values) - n :] for values in seconds.values()], axis=0)
    return {
        stage: {name: round(float(1e3 * np.percentile(values, q)), 2) for name, q in (("median", 50), ("p99", 99))}
        for stage, values in seconds.items()
        if len(values)
    }


def summary(run: dict[str, Any], folder: Path) -> str:
    """Return what was done in a few lines for a terminal."""
    points = run["points"]
    total = max(sum(points.values()), 1)
    spent = ", ".join(f"{stage} {ms['median']:.0f}/{ms['p99']:.0f}" for stage, ms in run["milliseconds"].items())
    return (
        f"{run['recording']['name']}: {run['recording']['scans']} scans, {total:,} points, {points['moving']:,} moving "
        f"({100 * points['moving'] / total:.2f} %)\n"
        f"{run['network']['engine']}, ms a scan, median/p99: {spent}\nlabels in {folder}/predictions"
    )
