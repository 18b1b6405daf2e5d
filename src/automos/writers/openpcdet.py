"""OpenPCDet's custom data set: points/*.npy, labels/*.txt and ImageSets; boxes of what moves, upright frame.

Scans in which nothing moves are not listed: its reader fails at an empty file of labels.
"""

from pathlib import Path

from automos.core.atomic import write_npy, write_text
from automos.results.run_files import RunFiles
from automos.writers.detector_sets import CLASS_OF_KIND, CLASSES, split_of
from automos.writers.formats import Export
from automos.writers.point_columns import upright_points


def write(run: RunFiles, out: Path) -> None:
    """Write the folder `out`; a line of labels is: centre x y z, length, width, height, heading, kind."""
    for folder in ("points", "labels", "ImageSets"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    listed = []
    for index in run.each("writing boxes"):
        moving, name = run.boxes_upright(index).moving, f"{index:06d}"
        if not moving:
            continue
        numbers = [" ".join(f"{value:.4f}" for value in (*box.center, *box.size, box.yaw)) for box in moving]
        lines = [f"{row} {CLASSES[CLASS_OF_KIND[box.kind]]}\n" for row, box in zip(numbers, moving, strict=True)]
        write_npy(out / "points" / f"{name}.npy", upright_points(run, index))
        write_text(out / "labels" / f"{name}.txt", "".join(lines))
        listed.append(name)
    for split, names in split_of(listed).items():
        write_text(out / "ImageSets" / f"{split}.txt", "".join(f"{name}\n" for name in names))


EXPORT = Export(writes="OpenPCDet custom data set: points/*.npy, labels/*.txt, ImageSets", write=write)
