import numpy as np
from worlds import Block, cast, van

from automos.array_sequence import ArraySequence
from automos.labels import Label
from automos.pipeline import label
from automos.scan import Scan
from automos.tracking.unfollowed import can_follow


def roadside(n_scans=14, gap=1.0):
    """Scans of a sensor on a pole beside a road, one a second, and which points are on traffic at 9 to 15 m/s."""
    rng = np.random.default_rng(0)
    azimuth = 2.0 * np.pi * (np.arange(720) + 0.5) / 720
    e, a = (g.ravel() for g in np.meshgrid(np.radians(np.linspace(-25.0, 8.0, 24)), azimuth))
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)
    houses = [Block((10.0 * k, side, 3.0), (6.0 + k % 3, 4.0, 6.0)) for k in range(-6, 7) for side in (-16.0, 17.0)]
    static = (*houses, *(van(9.0 * k, 9.5) for k in range(-4, 5)))
    cars = []
    for lane, way in ((-6.0, 1.0), (-3.0, 1.0), (1.0, -1.0), (4.0, -1.0)):
        for start in np.cumsum(rng.uniform(1.5, 5.0, 8)) - 6.0:
            speed = way * rng.uniform(9.0, 15.0)
            cars.append(Block((-60.0 * way - speed * start, lane, 0.8), (4.5, 1.9, 1.5), velocity=(speed, 0.0, 0.0)))
    scans, truth = [], []
    for i in range(n_scans):
        distance, hit = cast((*static, *cars), np.array([0.0, 0.0, 4.0]), rays, gap * i)
        seen = distance < 60.0
        measured = distance[seen] + rng.normal(0.0, 0.02, seen.sum())
        scans.append(Scan((measured[:, None] * rays[seen]).astype(np.float32), stamp=gap * i))
        truth.append(hit[seen] >= len(static))
    return ArraySequence(scans, is_compensated=True), np.concatenate(truth)


def test_at_one_scan_a_second_what_passes_is_told_by_the_evidence_alone():
    sequence, moves = roadside()
    result = label(sequence, poses=np.tile(np.eye(4), (len(sequence), 1, 1)), workers=1)
    found = np.concatenate([result.labels(i) for i in range(len(sequence))]) == Label.MOVING
    assert (found & moves).sum() > 0.8 * moves.sum()
    assert (found & moves).sum() > 0.98 * found.sum()
    assert len(result.tracks) == 0


def test_ten_scans_a_second_are_followed_and_two_are_not():
    assert can_follow(0.1 * np.arange(20))
    assert not can_follow(0.5 * np.arange(20))
    assert can_follow(np.zeros(1))
