"""Label scans that are arrays in memory: a cyclist overtakes the sensor in a walled square."""

import numpy as np

import automos

azimuth, elevation = np.meshgrid(np.radians(np.arange(0.1, 360.0, 0.8)), np.radians(np.linspace(-21.9, 4.1, 32)))
rays = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1)
rays = rays.reshape(-1, 3)
noise = np.random.default_rng(0)


def sweep(time: float) -> np.ndarray:
    """Return (N, 3) points in metres, sensor frame; the sensor drives at 2 m/s, the cyclist rides at 6 m/s."""
    sensor = np.array([2.0 * time, 0.0, 1.8])
    walls = np.where(rays > 0, [20.0, 12.0, np.inf], [-20.0, -12.0, 0.0])
    distance = ((walls - sensor) / rays).min(axis=1)
    cyclist, half = np.array([6.0 * time - 7.0, 5.0, 0.9]), np.array([0.85, 0.3, 0.9])
    faces = np.sort([(cyclist - half - sensor) / rays, (cyclist + half - sensor) / rays], axis=0)
    enters, leaves = faces[0].max(axis=1), faces[1].min(axis=1)
    measured = np.where((enters > 0) & (enters < leaves), enters, distance) + noise.normal(0.0, 0.01, len(rays))
    return measured[:, None] * rays


stamps = 0.1 * np.arange(24)
result = automos.label(automos.ArraySequence([sweep(t) for t in stamps], stamps, is_compensated=True))

for i in range(0, len(result), 4):
    labels = result.labels(i)  # one per point, in the order of the array: 9 static, 251 moving, 0 unlabeled
    print(f"scan {i:2}: {len(labels)} points, {(labels == automos.Label.MOVING).sum()} moving")
