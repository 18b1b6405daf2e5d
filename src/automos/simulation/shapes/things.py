"""A thing: what stands or moves in a world as one rigid body, with the box an annotator would draw around it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from automos.simulation.shapes.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Thing:
    """A shape with a name. Body frame: x forward, y left, z up, origin on the ground.

    Attributes
    ----------
    kind : str
        "car", "person", ...
    frames : tuple of Mesh
        Meshes; more than one for what changes its shape as it goes (legs), shown in turn along `stride`.
    stride : float
        Metres travelled per cycle of the frames.
    axles : tuple[float, float]
        X of the rear and front point that follow the path, metres.
    gap : float
        Metres along the path from the origin of what pulls it back to its own.
    """

    kind: str
    frames: tuple[Mesh, ...]
    stride: float = 1.0
    axles: tuple[float, float] = (-0.1, 0.1)
    gap: float = 0.0

    @cached_property
    def bounds(self) -> npt.NDArray[np.float64]:
        """(2, 3) least and greatest corner over all frames."""
        corners = np.array([frame.bounds for frame in self.frames])
        return np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])

    @cached_property
    def size(self) -> npt.NDArray[np.float64]:
        """(3,) length, width, height."""
        low, high = self.bounds
        return high - low

    @cached_property
    def center(self) -> npt.NDArray[np.float64]:
        """(3,) middle of the box, body frame."""
        return self.bounds.mean(axis=0)

    @cached_property
    def radius(self) -> float:
        """Radius of the sphere about `center` that holds the thing."""
        return float(0.5 * np.linalg.norm(self.size))
