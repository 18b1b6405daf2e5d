"""Boxes and tracks as in KITTI's tracking benchmark: label_02/SSSS.txt, and the calibration that goes with it.

KITTI's boxes are in a camera's frame: x right, y down, z forward, upright about y. Here that is a camera at the sensor
that looks along its heading, level at the first scan; its pose is in calib/SSSS.txt. There is no picture, so boxes in
the image are -1 and alpha is -10, as for results in 3D only.
"""

from pathlib import Path

import numpy as np

from automos.core.atomic import write_text
from automos.core.geometry import inverse, make_transform, transform
from automos.results.run_files import RunFiles
from automos.writers.formats import Export

R_CAMERA_UPRIGHT = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""From x forward, y left, z up to x right, y down, z forward."""


def write(run: RunFiles, out: Path) -> None:
    """Write `out / label_02 / <recording>.txt` and `out / calib / <recording>.txt`.

    A line is: frame, track, type (Moving, Static, Unknown), truncated, occluded, alpha, image box, height, width,
    length, bottom centre x, y, z in the camera's frame, rotation about its y-axis, confidence of the type.
    """
    T_camera_sensor = make_transform(R_CAMERA_UPRIGHT) @ run.T_upright_sensor(0)
    lines = []
    for index in run.each("writing tracks"):
        found = run.boxes_level(index)
        T_camera_level = T_camera_sensor @ inverse(run.T_level_sensor(index))
        bottom = found.boxes.center - 0.5 * found.boxes.size * [0.0, 0.0, 1.0]
        location = transform(T_camera_level, bottom)
        heading = np.column_stack([np.cos(found.boxes.yaw), np.sin(found.boxes.yaw), np.zeros(len(found))])
        heading = heading @ T_camera_level[:3, :3].T
        rotation_y = np.arctan2(-heading[:, 2], heading[:, 0])
        for box, (x, y, z), turn in zip(found, location, rotation_y, strict=True):
            length, width, height = box.size
            occluded = 0 if box.is_observed else 3  # 3: unknown
            lines.append(
                f"{index} {box.id} {box.verdict.capitalize()} 0 {occluded} -10 -1 -1 -1 -1 {height:.4f} {width:.4f} "
                f"{length:.4f} {x:.4f} {y:.4f} {z:.4f} {turn:.5f} {box.score:.4f}\n"
            )
    for folder in ("label_02", "calib"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    name = run.sequence.name
    write_text(out / "label_02" / f"{name}.txt", "".join(lines))
    numbers = " ".join(f"{value:.12e}" for value in T_camera_sensor[:3].ravel())
    write_text(out / "calib" / f"{name}.txt", f"R_rect 1 0 0 0 1 0 0 0 1\nTr_velo_cam {numbers}\n")


EXPORT = Export(writes="KITTI tracking text: label_02/*.txt, calib/*.txt", write=write)
