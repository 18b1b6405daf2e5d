"""What a recording is made with beside scenario and sensor: what carries it, where it sits, the air, bright signs."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.simulation.rigs import RIGS
from automos.simulation.sensing.returns import WEATHER
from automos.simulation.traffic.motion import transforms

MOUNTS = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1.7, 0.85, -0.75, 0.9, 0.05, 0.0],
        [1.7, -0.85, -0.75, -0.9, 0.05, 0.0],
        [-1.7, 0.0, -0.5, np.pi, 0.05, 0.0],
    ]
)
"""x, y, z in metres, yaw, pitch, roll in radians of up to four LiDARs on one vehicle, from the first one's place."""


@dataclass(frozen=True)
class Conditions:
    """The conditions of a simulated recording.

    Attributes
    ----------
    rig : str
        What carries the sensor, one of `RIGS`.
    weather : str
        One of `WEATHER`.
    blooming : bool
        Bright signs bleed into the beams beside them.
    mount : int
        Which of `MOUNTS` the sensor sits in.
    """

    rig: str = "car"
    weather: str = "clear"
    blooming: bool = False
    mount: int = 0

    def __post_init__(self) -> None:
        for name, known in (("rig", RIGS), ("weather", WEATHER)):
            if getattr(self, name) not in known:
                raise InputError(f"{name} is {getattr(self, name)!r}; choose one of: {', '.join(known)}.")
        if not 0 <= self.mount < len(MOUNTS):
            raise InputError(f"mount is {self.mount}; there are {len(MOUNTS)}, from 0.")

    @property
    def T_first_mount(self) -> npt.NDArray[np.float64]:
        """(4, 4): from this LiDAR's frame to the first one's."""
        return transforms(MOUNTS[self.mount])
