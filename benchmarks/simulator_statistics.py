"""Does a simulated recording look like a real one? Statistics of both, side by side.

    AUTOMOS_RECORDINGS=folder python benchmarks/simulator_statistics.py [--scans 12] [--seeds 0 1 2] [--json out.json]

The folder holds sequences/kitti_0005 (a city) and sequences/kitti_0027 (a road through vegetation), HDL-64E drives in
KITTI's layout. They are set against the scenarios `city` and `country`; lines that differ by more than a factor of 1.5
are marked.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

import numpy as np
from scores import finite

from automos import simulation
from automos.core.scan import Sequence
from automos.readers import open_recordings

PAIRS = (("kitti_0005", "city"), ("kitti_0027", "country"))
MAX_RANGE = 80.0
"""Metres at which the real recordings are cut off."""
FIELD = (-23.6, 2.0)
"""Degrees of elevation both look at: the real unit's beams point half a degree higher than its maker publishes."""
RANGES = (0.0, 5.0, 10.0, 20.0, 30.0, 50.0, MAX_RANGE)
N_BEAMS = 64
BEAM_GROUP = 8
PATCH = 0.7
"""Metres, side of the cubes in which surfaces are looked at."""
TOLERANCE = 1.5


def rings_of(points: np.ndarray) -> np.ndarray:
    """Return (N,) beam numbers of a scan written beam by beam, each counter-clockwise from straight ahead."""
    azimuth = np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi)
    return np.minimum(np.concatenate([[0], np.cumsum(np.diff(azimuth) < -np.pi)]), N_BEAMS - 1)


def in_beam_order(points: np.ndarray, ring: np.ndarray) -> np.ndarray:
    """Return (N,) rows that sort a scan by beam and, within a beam, by azimuth."""
    return np.lexsort((np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi), ring))


def ground_mask(points: np.ndarray) -> np.ndarray:
    """Return (N,) bool: within 0.2 m of the lowest points of their polar cell, which must not rise steeply outward."""
    away = np.hypot(points[:, 0], points[:, 1])
    sector = ((np.arctan2(points[:, 1], points[:, 0]) + np.pi) / (2 * np.pi) * 72).astype(int) % 72
    band = np.minimum((away / 2.0).astype(int), 39)
    cell = sector * 40 + band
    low = np.full(72 * 40, np.inf)
    order = np.lexsort((points[:, 2], cell))
    first = np.searchsorted(cell[order], np.arange(72 * 40))
    counts = np.bincount(cell, minlength=72 * 40)
    filled = counts > 0
    low[filled] = points[order[np.minimum(first + counts // 50, len(points) - 1)], 2][filled]
    low = low.reshape(72, 40)
    level = np.full(72, np.median(low[:, 2][np.isfinite(low[:, 2])]))
    for k in range(40):
        ok = low[:, k] < level + 0.35
        low[~ok, k] = level[~ok]
        level = np.where(ok, low[:, k], level)
    return points[:, 2] < low.ravel()[cell] + 0.2


def patches(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (P,) counts, (P, 3) ascending standard deviations and (P,) |normal z| of points 5-20 m away, by cubes."""
    away = np.linalg.norm(points, axis=1)
    points = points[(away > 5.0) & (away < 20.0)].astype(np.float64)
    _, cube, counts = np.unique(np.floor(points / PATCH).astype(int), axis=0, return_inverse=True, return_counts=True)
    cube = cube.ravel()
    mean = np.stack([np.bincount(cube, points[:, k]) for k in range(3)], axis=1) / counts[:, None]
    d = points - mean[cube]
    cov = np.stack([np.bincount(cube, d[:, i] * d[:, j]) for i in range(3) for j in range(3)], axis=1)
    cov = cov.reshape(-1, 3, 3) / counts[:, None, None]
    enough = counts >= 15
    values, vectors = np.linalg.eigh(cov[enough])
    return counts[enough], np.sqrt(np.maximum(values, 0.0)), np.abs(vectors[:, 2, 0])


def scan_statistics(points: np.ndarray, ring: np.ndarray) -> dict[str, float]:
    """Return the statistics of one scan."""
    away = np.linalg.norm(points, axis=1)
    kept = (away > 1.4) & (away < MAX_RANGE)  # the real recordings hold no returns nearer
    points, ring, away = points[kept], ring[kept], away[kept]
    order = in_beam_order(points, ring)
    points, ring, away = points[order], ring[order], away[order]
    elevation = np.degrees(np.arcsin(points[:, 2] / away))
    seen_by_both = away[(elevation > FIELD[0]) & (elevation < FIELD[1])]
    out = {"points per scan": float(len(points))}
    share = np.histogram(seen_by_both, RANGES)[0] / len(seen_by_both)
    out |= {f"share at {a:.0f}-{b:.0f} m": float(s) for a, b, s in zip(RANGES[:-1], RANGES[1:], share, strict=True)}
    out["share of ground"] = float(ground_mask(points).mean())
    rates = np.bincount(ring, minlength=N_BEAMS) / np.bincount(ring).max()
    for k in range(0, N_BEAMS, BEAM_GROUP):
        out[f"return rate, beams {k}-{k + BEAM_GROUP - 1}"] = float(rates[k : k + BEAM_GROUP].mean())
    same = ring[1:] == ring[:-1]
    jump = np.abs(np.diff(away))[same]
    out["jumps > 0.5 m along a beam"] = float((jump > 0.5).mean())
    step = np.diff(np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi))[same]
    out["single missing returns"] = float(((step > 1.5 * np.median(step)) & (step < 2.5 * np.median(step))).mean())
    counts, deviation, upright = patches(points)
    flat = (deviation[:, 1] > 0.08) & (deviation[:, 0] < 0.3 * deviation[:, 1])
    out["noise of level patches, m"] = float(np.median(deviation[flat & (upright > 0.9), 0]))
    out["noise of upright patches, m"] = float(np.median(deviation[flat & (upright < 0.3), 0]))
    out["share of points in rough patches"] = float(counts[~flat].sum() / counts.sum())
    return out


def statistics_of(sequence: Sequence, scans: np.ndarray) -> dict[str, float]:
    """Return the mean statistics over some scans; the share of moving points is over the labelled ones."""
    rows, moving, labelled = [], 0, 0
    for k in scans:
        scan = sequence[int(k)]
        ring = rings_of(scan.points) if scan.ring is None else scan.ring.astype(int)
        rows.append(scan_statistics(scan.points[scan.is_valid], ring[scan.is_valid]))
        truth = sequence.truth(int(k))
        if truth is not None:
            moving += int(np.count_nonzero(truth & 0xFFFF == 251))
            labelled += int(np.count_nonzero(truth & 0xFFFF))
    out = {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}
    out["share of moving points"] = moving / labelled if labelled else float("nan")
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scans", type=int, default=12, help="scans looked at per recording")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    root = Path(os.environ.get("AUTOMOS_RECORDINGS", "recordings"))
    results = {}
    for real_name, scenario in PAIRS:
        recording = open_recordings(root / "sequences" / real_name)[0]
        real = statistics_of(recording, np.linspace(0, len(recording) - 2, args.scans).astype(int))
        runs = []
        for seed in args.seeds:
            sequence = simulation.simulate(scenario, "HDL-64E", 150, seed)
            runs.append(statistics_of(sequence, np.linspace(0, 149, max(2, args.scans // 2)).astype(int)))
        simulated = {key: float(np.mean([run[key] for run in runs])) for key in real}
        results[f"{real_name} / {scenario}"] = {"real": finite(real), "simulated": simulated}
        print(f"\n{'':36s}{real_name:>12s}{scenario:>12s}   ratio")
        for key, value in real.items():
            ratio = simulated[key] / value if value else float("nan")
            mark = "" if 1 / TOLERANCE <= ratio <= TOLERANCE or not np.isfinite(ratio) else "  <--"
            print(f"{key:36s}{value:12.4g}{simulated[key]:12.4g}{ratio:8.2f}{mark}")
    if args.json:
        args.json.write_text(json.dumps(results, indent=2) + "\n")


if __name__ == "__main__":
    main()
