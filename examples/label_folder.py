"""Label a folder of scans, one .bin file each (x, y, z, intensity), and keep what stands still of the first.

Where there is no folder `my_log`, a simulated street is written there, so that this example runs anywhere.
"""

from pathlib import Path

import numpy as np

import automos

if not Path("my_log").exists():
    from automos.simulation import simulate

    Path("my_log").mkdir()
    for scan in simulate("city", "VLP-16", n_scans=16):
        np.column_stack([scan.points, scan.intensity]).astype(np.float32).tofile(f"my_log/{scan.name}.bin")

# README shows from here on
scans = [np.fromfile(file, np.float32).reshape(-1, 4) for file in sorted(Path("my_log").glob("*.bin"))]
result = automos.label(scans)  # or automos.label(automos.open_sequence("my_log"), progress=print)

is_moving = result.labels(0) == automos.Label.MOVING  # one per point of the first scan, in its order
T_world_sensor = result.trajectory.T_world_sensor[0]  # (4, 4): p_world = T_world_sensor @ p_sensor
standing = scans[0][~is_moving, :3] @ T_world_sensor[:3, :3].T + T_world_sensor[:3, 3]

movers = [found for found in result.objects if found.verdict == "moving"]  # with boxes, kind, when each moves
flow = result.points(0).flow  # (N, 3) metres to the next scan; points(0).object, .confidence
result.save("saved")  # as `automos label` writes it; automos.load("saved") reads either
# to here

print(f"{len(result)} scans; of the first, {is_moving.sum()} of {len(is_moving)} points are moving")
print(f"{len(standing)} points of it stand still, the first at {np.round(standing[0], 2)} m")
print(f"{len(movers)} objects move; the flow of {np.isfinite(flow[:, 0]).sum()} points is known")
