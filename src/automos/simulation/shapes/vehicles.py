"""Cars, vans, lorries, buses and trams: lofted bodies with glass, wheels, plates and something dark inside.

Every maker takes a random generator and returns a :class:`Thing` whose sizes and paint vary within what is on the road.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import Mesh, Section, Vector, box, boxes_on_both_sides, join, loft, of_parts, wheel
from automos.simulation.shapes.things import Thing

GLASS = Material.CAR_GLASS
_PAINTS = np.array([0.15, 0.2, 0.25, 0.35, 0.55, 0.8, 1.0, 1.2, 1.5])
"""Tints of black, dark, grey, silver, coloured and white paint."""


def _paint(rng: np.random.Generator) -> float:
    return float(rng.choice(_PAINTS) * rng.uniform(0.85, 1.15))


def _wheels(xs: Iterable[float], half_width: float, radius: float) -> Mesh:
    width = 0.62 * radius
    y = half_width - 0.5 * width
    return join([wheel((x, side * y, radius), radius, width) for x in xs for side in (-1.0, 1.0)])


@of_parts
def _plates_and_lamps(front: float, rear: float, half_width: float, height: float) -> Iterator[Mesh]:
    yield box((0.02, 0.50, 0.11), (front + 0.01, 0.0, 0.45), Material.RETRO, 0.5)
    yield box((0.02, 0.50, 0.11), (rear - 0.01, 0.0, height - 0.15), Material.RETRO, 0.5)
    for side in (-1.0, 1.0):
        y = side * (half_width - 0.20)
        yield box((0.03, 0.24, 0.14), (rear - 0.01, y, height), Material.RETRO, 0.15)
        yield box((0.03, 0.28, 0.14), (front - 0.03, y, height - 0.08), Material.CAR_GLASS)


def _seats(rows: Iterable[float], half_width: float, floor: float) -> Mesh:
    size, y, z = (0.12, 0.48, 0.85), 0.45 * half_width, floor + 0.43
    return join([boxes_on_both_sides(size, (x, y, z), Material.CLOTH, 0.4) for x in rows])


def _pillars(rows: Iterable[float], half_width: float, size: Vector, height: float) -> Mesh:
    return join([boxes_on_both_sides(size, (x, half_width, height), Material.PAINT) for x in rows])


_CAR_SHAPES = {
    # length, width, height, cabin front foot, roof front, roof rear, cabin rear foot (fractions from front)
    "sedan": (4.65, 1.80, 1.45, 0.27, 0.42, 0.70, 0.86),
    "hatchback": (4.00, 1.74, 1.48, 0.24, 0.40, 0.88, 0.97),
    "estate": (4.75, 1.82, 1.47, 0.26, 0.40, 0.92, 0.98),
    "suv": (4.55, 1.88, 1.68, 0.24, 0.38, 0.88, 0.97),
}


def make_car(rng: np.random.Generator, shape: str | None = None) -> Thing:
    """Return a passenger car: a sedan, hatchback, estate or SUV."""
    shape = shape or str(rng.choice(list(_CAR_SHAPES), p=[0.25, 0.35, 0.2, 0.2]))
    *size, foot, roof_front, roof_rear, tail = _CAR_SHAPES[shape]
    length, width, height = np.array(size) * rng.uniform((0.93, 0.97, 0.97), (1.06, 1.04, 1.05))
    front, half, clearance = 0.5 * length, 0.5 * width, 0.20
    belt = 0.62 * height
    deck = 0.66 * height if shape == "sedan" else belt + 0.02

    def at(fraction: float) -> float:
        return front - fraction * length

    sections = [  # from the rear bumper forward; each rules the strip up to the next
        Section(at(1.0), 0.35, 0.45 * height, 0.52 * height, 0.86 * half, 0.78 * half),
        Section(at(0.985), clearance, 0.50 * height, deck, 0.95 * half, 0.84 * half),
        Section(at(tail), clearance, belt, deck + 0.03, half, 0.82 * half, GLASS, GLASS),
        Section(at(roof_rear), clearance, belt, 0.985 * height, half, 0.72 * half, GLASS),
        Section(at(0.55), clearance, belt, height, half, 0.74 * half, GLASS),
        Section(at(roof_front), clearance, belt, 0.98 * height, half, 0.74 * half, GLASS, GLASS),
        Section(at(foot), clearance, 0.60 * height, 0.66 * height, half, 0.86 * half),
        Section(at(0.03), clearance, 0.42 * height, 0.53 * height, 0.95 * half, 0.80 * half),
        Section(at(0.0), 0.30, 0.36 * height, 0.44 * height, 0.86 * half, 0.76 * half),
    ]
    axle_front, axle_rear = front - 0.19 * length, -front + 0.19 * length
    radius = 0.31 if shape != "suv" else 0.36
    pillar = 0.5 * (at(roof_front) + at(roof_rear))
    post, mirror = (pillar, 0.88 * half, 0.80 * height), (at(foot) - 0.35, half + 0.05, 0.70 * height)
    parts = [
        loft(sections).painted(_paint(rng)),
        _wheels((axle_front, axle_rear), half, radius),
        _plates_and_lamps(front, -front, half, 0.45 * height),
        _seats((at(0.52), at(0.75)), half, 0.35),
        boxes_on_both_sides((0.10, 0.03, 0.30 * height), post, Material.PLASTIC),
        boxes_on_both_sides((0.12, 0.16, 0.12), mirror, Material.PLASTIC),
    ]
    return Thing("car", (join(parts),), axles=(axle_rear, axle_front))


def make_van(rng: np.random.Generator) -> Thing:
    """Return a panel van."""
    length, half, height = rng.uniform(4.9, 6.2), rng.uniform(0.95, 1.02), rng.uniform(1.95, 2.6)
    front = 0.5 * length
    belt = 1.25
    paint = float(rng.choice([0.3, 1.2, 1.5]))
    sections = [
        Section(-front, 0.35, belt, height - 0.03, half * 0.98, half * 0.9),
        Section(front - 1.9, 0.25, belt, height, half, half * 0.9, GLASS),
        Section(front - 1.5, 0.25, belt, height - 0.05, half, half * 0.86, GLASS, GLASS),
        Section(front - 0.75, 0.25, 1.0, 1.18, half, half * 0.85),
        Section(front - 0.05, 0.30, 0.75, 0.95, half * 0.95, half * 0.8),
        Section(front, 0.35, 0.60, 0.80, half * 0.9, half * 0.75),
    ]
    axles = (-front + 0.22 * length, front - 0.85)
    parts = [
        loft(sections).painted(paint),
        _wheels(axles[::-1], half, 0.34),
        _plates_and_lamps(front, -front, half, 0.8),
        _seats((front - 2.0,), half, 0.6),
    ]
    return Thing("van", (join(parts),), axles=axles)


def _cab(front: float, half: float, height: float, depth: float, paint: float) -> Mesh:
    sections = [
        Section(front - depth, 0.5, 1.9, height, half, half * 0.97),
        Section(front - 0.9, 0.5, 1.75, height, half, half * 0.97, GLASS),
        Section(front - 0.15, 0.45, 1.55, height - 0.35, half, half * 0.95),
        Section(front, 0.45, 1.45, height - 0.55, half * 0.97, half * 0.92),
    ]
    windscreen = box((0.02, 1.8 * half, 0.75), (front, 0.0, 0.5 * height + 0.45), GLASS)
    return join([loft(sections).painted(paint), windscreen])


def _cargo(length: float, half: float, heights: tuple[float, float], middle: float, tint: float) -> Mesh:
    low, high = heights
    return box((length, 2 * half, high - low), (middle, 0.0, 0.5 * (high + low)), Material.PAINT, tint)


def make_lorry(rng: np.random.Generator) -> Thing:
    """Return a rigid delivery lorry with a box body."""
    length, half, height = rng.uniform(7.0, 9.5), 1.22, rng.uniform(3.1, 3.7)
    front = 0.5 * length
    body = length - 2.1
    axles = (-front + 0.26 * length, front - 1.3)
    parts = [
        _cab(front, half * 0.95, 2.7, 2.0, _paint(rng)),
        _cargo(body, half, (1.0, height), -front + 0.5 * body, rng.uniform(0.6, 1.4)),
        box((length - 0.4, 0.9, 0.3), (0.0, 0.0, 0.82), Material.METAL, 0.4),
        _wheels(axles[::-1], half, 0.45),
        _plates_and_lamps(front, -front, half, 0.9),
    ]
    return Thing("truck", (join(parts),), axles=axles)


def make_tractor_and_trailer(rng: np.random.Generator) -> tuple[Thing, Thing]:
    """Return an articulated lorry: the tractor and the semi-trailer whose front rests 1 m behind the tractor's middle.

    The trailer's axles are its kingpin and its bogie, so that placing both on the path makes it follow.
    """
    half, front = 1.25, 3.0
    tractor = [
        _cab(front, half * 0.98, rng.uniform(3.0, 3.7), 2.3, _paint(rng)),
        box((5.7, 0.9, 0.35), (0.0, 0.0, 0.85), Material.METAL, 0.4),
        _wheels((1.6, -1.9), half, 0.5),
        _plates_and_lamps(front, -front + 0.6, half, 0.8),
    ]
    length, height = 13.6, rng.uniform(3.7, 4.0)
    trailer = [
        _cargo(length, half, (1.15, height), 0.0, rng.uniform(0.5, 1.4)),
        box((length - 1.0, 1.0, 0.3), (0.0, 0.0, 1.0), Material.METAL, 0.4),
        _wheels((-2.6, -5.2, -3.9), half, 0.5),
        box((2.6, 2 * half - 0.1, 0.5), (0.6, 0.0, 0.75), Material.PLASTIC),
        box((0.03, 2 * half - 0.2, 0.12), (-0.5 * length - 0.02, 0.0, 1.1), Material.RETRO, 0.3),
    ]
    axles, gap = (-3.9, 0.5 * length - 1.2), 6.6
    return Thing("truck", (join(tractor),), axles=(-1.9, 1.6)), Thing("trailer", (join(trailer),), 1.0, axles, gap)


def make_bus(rng: np.random.Generator) -> Thing:
    """Return a city bus."""
    front, half = 6.0, 1.27
    stations = np.linspace(-front, front, 9)
    sections = [Section(x, 0.35, 1.25, 3.05, half, half * 0.96, GLASS) for x in stations]
    shell = [loft(sections, caps=GLASS), _pillars(stations, half * 0.985, (0.25, 0.04, 1.7), 2.1)]
    parts = [
        join(shell).painted(_paint(rng)),
        _seats(np.arange(-4.5, 4.6, 0.9), half * 1.3, 0.5),
        _wheels((3.1, -2.8), half, 0.48),
        _plates_and_lamps(front, -front, half, 0.9),
    ]
    return Thing("bus", (join(parts),), axles=(-2.8, 3.1))


def make_tram_car(rng: np.random.Generator) -> Thing:
    """Return one section of an articulated tram."""
    length, half = 9.5, 1.2
    stations = np.linspace(-0.5 * length, 0.5 * length, 7)
    sections = [Section(x, 0.15, 1.2, 3.4, half, half * 0.95, GLASS) for x in stations]
    parts = [
        loft(sections, caps=Material.PLASTIC),
        _pillars(stations, half * 0.98, (0.35, 0.04, 1.9), 2.2),
        box((3.0, 2.0, 0.5), (0.0, 0.0, 0.3), Material.METAL, 0.4),
    ]
    mesh = join(parts).painted(rng.uniform(0.5, 1.2))
    return Thing("tram", (mesh,), axles=(-0.35 * length, 0.35 * length), gap=length + 0.5)
