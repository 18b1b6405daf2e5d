"""OpenPCDet's custom data set: points/*.npy, labels/*.txt and ImageSets; boxes of what moves, upright frame.

Scans in which nothing moves are not listed: its reader fails at an empty file of labels.
"""

from __future__ import annotations

from pathlib import Path

from automos.core.atomic import write_npy, write_text
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.kinds import KINDS, kinds_of_tracks
from automos.writers.movers import only_moving, split_of, upright_points


def write(run: RunFiles, out: Path) -> None:
    """Write the folder `out`; a line of labels is: centre x y z, length, width, height, heading, kind."""
    for folder in ("points", "labels", "ImageSets"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    kinds, listed = kinds_of_tracks(run), []
    for index in run.each("writing boxes"):
        found = only_moving(run.boxes_upright(index))
        if not len(found):
            continue
        name, boxes = f"{index:06d}", found.boxes
        lines = [
            " ".join(f"{value:.4f}" for value in (*boxes.center[k], *boxes.size[k], boxes.yaw[k])) + f" {KINDS[kind]}\n"
            for k, kind in enumerate(kinds(found.ids))
        ]
        write_npy(out / "points" / f"{name}.npy", upright_points(run, index))
        write_text(out / "labels" / f"{name}.txt", "".join(lines))
        listed.append(name)
    for split, names in split_of(listed).items():
        write_text(out / "ImageSets" / f"{split}.txt", "".join(f"{name}\n" for name in names))


EXPORT = Export(writes="OpenPCDet custom data set: points/*.npy, labels/*.txt, ImageSets", write=write)
