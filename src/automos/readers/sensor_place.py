"""Where in a cloud's coordinates its sensor was, as far as the points show it.

A sensor measures in directions, so that its points lie further apart the further they are from it: in a cloud in the
sensor's frame, ranks of the distance to the next points and of the distance from the origin go together. Where they
do not, and would go together from another place, that is where the sensor was, and the cloud is in another frame: that
of a map, or of where the drive began. Points on a grid, of one distance everywhere, show nothing. Where no place fits
and the next cloud has the very same points once more, they are a map that grows, which no pose takes back.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from automos.core.arrays import evenly_spread
from automos.core.errors import InputError
from automos.core.geometry import Array, inverse, transform
from automos.core.scan import MIN_RANGE, Pose
from automos.readers.units import are_angles, entropy

_LOOKS = 3
"""Scans that are looked at."""
_ASKED, _AMONG = 2000, 50_000
"""Points whose distance to the next is taken, among so many of the cloud, at random; half as many at least."""
_NEXT = 2
"""Number of the neighbour whose distance counts: the first may be the same point once more."""
_LEAST, _CLEARLY = 0.5, 1.6
"""Correlation that another place must have to be where the sensor was, and how many times as much the origin leaves
unexplained: in the sensor's own frame that is at most 1.4 times as much."""
_OWN = 0.75
"""Correlation from which a cloud is surely what one sensor saw."""
_SAME = 0.05
"""Difference of correlations, or of bits, that says nothing."""
_EDGE, _OUTSIDE = 1.2, 3.0
"""Times the reach of the points: a sensor that looks forward is at their edge, and none looks at them from outside."""
_ELEVATION = 0.1
"""Degrees between elevations that are told apart."""

RawPoints = Callable[[int], Array]
"""Returns the (N, 3) coordinates of a scan as its file has them."""


def ranks(values: Array) -> Array:
    """Return the rank of each of `values` (N,), from 1; equal ones share the mean of theirs."""
    # scipy.stats has this, too, and takes most of a second to import.
    _, which, n = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(n) - 0.5 * (n - 1))[which]


def frame_said(T_frame_sensor: Pose | None) -> str:
    """Return in words what clouds are given in, of what `find_frame` returns."""
    return "the sensor's own" if T_frame_sensor is None else "a map's, from which they were taken back"


class Spacing:
    """Some points of a cloud, and how far apart the points are there."""

    def __init__(self, cloud: Array):
        """Take (N, 3) coordinates; those that are no point, zero or not finite, are left out."""
        from scipy.spatial import KDTree

        random = np.random.default_rng(0)
        cloud = cloud[np.isfinite(cloud).all(axis=1) & (np.abs(cloud).max(axis=1, initial=0.0) > MIN_RANGE)]
        cloud = cloud[random.permutation(len(cloud))[:_AMONG]]
        asked = cloud[:_ASKED]
        apart = KDTree(cloud).query(asked, k=_NEXT + 1)[0][:, _NEXT] if len(cloud) else np.zeros(0)
        self.points, self.rank = asked[apart > 0.0], ranks(apart[apart > 0.0])
        self.is_enough = 2 * len(self.points) >= _ASKED

    def fit(self, place: Array) -> float:
        """Return the correlation of the points' spacing with their distance from `place` (3,), by ranks."""
        return float(np.corrcoef(ranks(np.linalg.norm(self.points - place, axis=1)), self.rank)[0, 1])

    def starts(self) -> list[Array]:
        """Return places (3,) amid the densest points."""
        dense = self.points[np.argsort(self.rank)[: len(self.rank) // 10]]
        return [dense.mean(axis=0), np.median(dense, axis=0)]

    def find(self) -> Array:
        """Return (3,) the place among the points from which the correlation is best."""
        from scipy.optimize import minimize

        around = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 2.0]])
        starts = self.starts()
        places = [*starts]
        for start in starts:
            options = {"initial_simplex": start + around, "maxfev": 120, "xatol": 0.1, "fatol": 1e-3}
            places.append(minimize(lambda place: -self.fit(place), start, method="Nelder-Mead", options=options).x)
        return max((one for one in places if self.beyond(one) < _EDGE), key=self.fit)

    def beyond(self, place: Array) -> float:
        """Return how far `place` (3,) is, horizontally, from the middle of the points, 1 being where they end."""
        low, high = self.points[:, :2].min(axis=0), self.points[:, :2].max(axis=0)
        return float(np.max(np.abs(place[:2] - 0.5 * (low + high))) / np.max(0.5 * (high - low)))


def find_frame(
    raw_points: RawPoints, n: int, claims: Sequence[Pose], is_trusted: bool, where: Path, fault: str = ""
) -> Pose | None:
    """Return (n, 4, 4) the sensor's poses in the frame of the clouds, None where that is the sensor's own.

    Parameters
    ----------
    raw_points, n : the clouds, and how many there are.
    claims : (n, 4, 4) poses that came with them, in frames that may be the clouds'.
    is_trusted : whether the first claim is what the format says the clouds' frame is, where points do not show it.
    where, fault : the recording, and why there are no more claims, for the message.

    Raises
    ------
    InputError
        The clouds are in the frame of a map, and nothing says where in it the sensor was.
    """
    far = np.argsort([-np.linalg.norm(T[:3, 3]) for T in claims[0]])[: max(n // 2, _LOOKS)] if claims else np.arange(n)
    looks, refused = evenly_spread(far.tolist(), _LOOKS), False
    spacings: dict[int, Spacing] = {}
    for index in looks:
        with suppress(InputError):  # reported when the scan itself is read
            spacings[index] = Spacing(cloud := raw_points(index))
            refused = refused or are_angles(cloud, turns=bool(claims))
    if refused:
        raise InputError(
            f"{where} holds ranges and angles, as it seems, where x, y and z are expected; write the coordinates "
            "instead, in metres"
        )
    spacings = {index: one for index, one in spacings.items() if one.is_enough}
    if not spacings:
        return claims[0] if is_trusted else None
    places = [np.zeros((n, 3)), *(T[:, :3, 3] for T in claims)]
    fits = [np.mean([one.fit(place[index]) for index, one in spacings.items()]) for place in places]
    best = int(np.argmax(fits))
    is_as_good = [fit > fits[best] - _SAME for fit in fits]
    if is_trusted and is_as_good[1] and not (is_as_good[0] and _has_sharper_beams(spacings, claims[0])):
        best = 1
    elif is_as_good[0]:
        best = 0
    for index, spacing in spacings.items():
        place = places[best][index]
        is_own = best == 0 and spacing.fit(place) > _OWN  # at rest, a sensor may see the very same once more
        if not is_own and _goes_on(spacing, raw_points(index), raw_points((index + 1) % n)):
            raise InputError(
                f"{where} has clouds that hold the points of those before them, a map that grows (accumulated in a "
                "world frame), not what the sensor saw in one sweep; give its scans as they were before that"
            )
        _require_sensor(spacing, place, where, fault)
    return None if best == 0 else claims[best - 1]


def _goes_on(spacing: Spacing, cloud: Array, other: Array) -> bool:
    """Return whether the next cloud, another than `cloud`, has most points of this one at the very same places."""
    known = set(map(bytes, np.ascontiguousarray(other)))
    n_known = sum(bytes(point) in known for point in np.ascontiguousarray(spacing.points))
    return 2 * n_known > len(spacing.points) and not np.array_equal(cloud, other, equal_nan=True)


def _has_sharper_beams(spacings: dict[int, Spacing], T_file_sensor: Pose) -> bool:
    """Return whether points lie at fewer elevations, as beams have them, seen from the origin than from the poses."""

    def spread(points: Array) -> float:
        x, y, z = points.T
        return entropy(np.bincount(((np.degrees(np.arctan2(z, np.hypot(x, y))) + 90.0) / _ELEVATION).astype(np.int64)))

    here = [spread(one.points) for one in spacings.values()]
    there = [spread(transform(inverse(T_file_sensor[index]), one.points)) for index, one in spacings.items()]
    return bool(np.mean(here) + _SAME < np.mean(there))


def _require_sensor(spacing: Spacing, place: Array, where: Path, fault: str) -> None:
    """Raise where the sensor was clearly elsewhere than at `place` (3,)."""
    fit = spacing.fit(place) if spacing.beyond(place) < _OUTSIDE else 0.0
    if fit >= max(map(spacing.fit, spacing.starts())):  # no need to search
        return
    found = spacing.find()
    # Heights tell little: over even ground, from a few metres further up or down all looks the same.
    nearest = np.linalg.norm(spacing.points - place, axis=1).min()
    is_about_there = fit > _OWN and np.linalg.norm((found - place)[:2]) < nearest
    if is_about_there or spacing.fit(found) < max(_LEAST, 1.0 - (1.0 - fit) / _CLEARLY):
        return
    raise InputError(
        f"{where} has clouds in the frame of a map (world frame): their points are spread as if seen from about "
        f"({found[0]:.0f}, {found[1]:.0f}), not from the origin; give the scans in the sensor's frame, or put the "
        f"sensor's pose of each, in the frame of the clouds, beside them as poses.txt{fault}"
    )


def read_viewpoints(paths: Sequence[Path], codec: str) -> tuple[Pose | None, list[str]]:
    """Return (N, 4, 4) where the headers of clouds say that the sensor was, None if they do not, and what to say."""
    if codec != "pcd":
        return None, []
    from automos.readers.pcd import read_headers

    return read_headers(paths)
