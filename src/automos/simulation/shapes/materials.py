"""What surfaces are made of, as an infrared beam sees them.

The values are typical of 905 nm: asphalt and pavement near 0.15-0.3, plaster 0.3-0.6, leaves near 0.5 (the red edge),
black rubber 0.05, retro-reflective sheeting tens of times a white sheet of paper.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np


class Material(IntEnum):
    """One number per mesh face."""

    ASPHALT, PAVEMENT, GRASS, SOIL, WALL, STONE, WINDOW, LEAVES, BARK = range(9)
    METAL, PAINT, PLASTIC, CAR_GLASS, RUBBER, CLOTH, SKIN, RETRO = range(9, 17)


@dataclass(frozen=True)
class Surface:
    """Optical properties of a material.

    Attributes
    ----------
    reflectivity : float
        Of a Lambertian sheet, 1 is white paper; a face's tint multiplies it.
    falloff : float
        The echo fades with cos(incidence)**falloff: 1 is Lambertian, small is rough (seen at grazing angles too).
    fuzz : float
        Metres, mean depth to which beams enter before they return (grass blades, foliage).
    lost : float
        Share of the hits that never come back (mirror-like surfaces).
    passed : float
        Share of the hits that go on behind the surface (panes).
    """

    reflectivity: float
    falloff: float
    fuzz: float = 0.0
    lost: float = 0.0
    passed: float = 0.0


SURFACES = {
    Material.ASPHALT: Surface(0.17, 0.30),
    Material.PAVEMENT: Surface(0.26, 0.30),
    Material.GRASS: Surface(0.42, 0.20, fuzz=0.06, lost=0.015),
    Material.SOIL: Surface(0.25, 0.25, fuzz=0.01),
    Material.WALL: Surface(0.42, 0.80),
    Material.STONE: Surface(0.30, 0.70),
    Material.WINDOW: Surface(0.25, 1.00, lost=0.12, passed=0.25),
    Material.LEAVES: Surface(0.45, 0.30, fuzz=0.03, lost=0.04),
    Material.BARK: Surface(0.28, 0.60),
    Material.METAL: Surface(0.45, 0.80, lost=0.01),
    Material.PAINT: Surface(0.45, 0.60, lost=0.02),
    Material.PLASTIC: Surface(0.20, 0.80),
    Material.CAR_GLASS: Surface(0.10, 1.50, lost=0.48, passed=0.40),
    Material.RUBBER: Surface(0.06, 0.50),
    Material.CLOTH: Surface(0.35, 0.60),
    Material.SKIN: Surface(0.50, 0.70),
    Material.RETRO: Surface(30.0, 0.30),
}


def column(name: str) -> np.ndarray:
    """Return (n_materials,) float32: property `name` of every material, to be indexed by material numbers."""
    return np.array([getattr(SURFACES[m], name) for m in Material], np.float32)
