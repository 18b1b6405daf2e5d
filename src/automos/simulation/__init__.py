"""Worlds with exact truth: a LiDAR simulator for testing, developing and showing labelers.

>>> from automos import simulation
>>> sequence = simulation.simulate("city", "HDL-64E", n_scans=20, seed=0)
>>> scan, labels = sequence[3], sequence.truth(3)
"""

from automos.simulation.annotations import Annotations
from automos.simulation.api import LONG, SCENARIOS, SENSORS, record, simulate
from automos.simulation.conditions import Conditions
from automos.simulation.recorders import Convention, write_recorded
from automos.simulation.sequence import FORMAT, SimulatedSequence
from automos.simulation.write import write

__all__ = [
    "FORMAT",
    "LONG",
    "SCENARIOS",
    "SENSORS",
    "Annotations",
    "Conditions",
    "Convention",
    "SimulatedSequence",
    "record",
    "simulate",
    "write",
    "write_recorded",
]
