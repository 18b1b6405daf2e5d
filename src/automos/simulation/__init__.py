"""Worlds with exact truth: a LiDAR simulator for testing, developing and showing labelers.

>>> from automos import simulation
>>> sequence = simulation.simulate("city", "HDL-64E", n_scans=20, seed=0)
>>> scan, labels = sequence[3], sequence.truth(3)
"""

from automos.core.errors import InputError
from automos.simulation.conditions import MOUNTS, Conditions
from automos.simulation.merged import MergedSequence
from automos.simulation.recorders import Convention, Recorded, write_recorded
from automos.simulation.recorders.convention import hint
from automos.simulation.scenarios import LONG
from automos.simulation.scenarios import SCENARIOS as _SCENARIOS
from automos.simulation.sensing.sensors import SENSORS as _SENSORS
from automos.simulation.sequence import FORMAT, SimulatedSequence
from automos.simulation.truth import Annotations
from automos.simulation.write import write

SCENARIOS: tuple[str, ...] = tuple(_SCENARIOS)
"""Names of the scenarios."""
SENSORS: tuple[str, ...] = tuple(_SENSORS)
"""Names of the sensors."""
MAX_SCANS = 1_000_000
"""More than a day of ten scans a second; worlds are built for all of their time at once."""


def simulate(
    scenario: str, sensor: str = "HDL-64E", n_scans: int = 100, seed: int = 0, compensated: bool = False
) -> SimulatedSequence:
    """Return a simulated recording; nothing is computed until a scan is asked for.

    Parameters
    ----------
    scenario : str
        One of `SCENARIOS`.
    sensor : str
        One of `SENSORS`.
    n_scans : int
        Sweeps, at least 1.
    seed : int
        Another seed, another world; at least 0.
    compensated : bool
        Take the sensor's own motion out of every sweep, as some recordings come.

    Raises
    ------
    InputError
        A name is unknown or a number out of range.
    """
    for what, name, known in (("scenario", scenario, SCENARIOS), ("sensor", sensor, SENSORS)):
        if name not in known:
            raise InputError(f"{what} {name!r} is unknown{hint(name, known)}; choose one of: {', '.join(known)}.")
    if not 1 <= n_scans <= MAX_SCANS:
        raise InputError(f"n_scans is {n_scans}; a simulation has 1 to {MAX_SCANS:,} scans.")
    if seed < 0:
        raise InputError(f"seed is {seed}; give 0 or a positive integer.")
    return SimulatedSequence(scenario, _SENSORS[sensor], n_scans, seed, compensated, Conditions())


def record(
    scenario: str,
    sensor: str = "HDL-64E",
    n_scans: int = 100,
    seed: int = 0,
    *,
    convention: Convention | None = None,
    conditions: Conditions | None = None,
    n_lidars: int = 1,
) -> Recorded:
    """Return a simulated recording as some recorder would have kept it.

    Parameters
    ----------
    scenario, sensor, seed : str and int
        As for `simulate`.
    n_scans : int
        Sweeps of the sensor; the recording has as many scans as the convention cuts of them.
    convention : Convention, optional
        Where scans are cut, in what order and with which times points are kept, which scans are lost.
    conditions : Conditions, optional
        What carries the sensor, the weather, whether bright signs bleed.
    n_lidars : int
        How many sensors of the kind the vehicle has, their clouds merged.

    Raises
    ------
    InputError
        A name is unknown or a number out of range.

    Examples
    --------
    >>> from automos.simulation import Conditions, Convention, record
    >>> recording = record("city", "VLP-16", 20, convention=Convention(turns=1.09), conditions=Conditions("truck"))
    >>> len(recording)
    18
    """
    if not 1 <= n_lidars <= len(MOUNTS):
        raise InputError(f"n_lidars is {n_lidars}; give 1 to {len(MOUNTS)}.")
    plain = simulate(scenario, sensor, n_scans, seed)
    given = scenario, plain.sensor, n_scans, seed, plain.compensated, conditions or Conditions()
    turns = SimulatedSequence(*given) if n_lidars == 1 else MergedSequence(*given, n_lidars)
    return Recorded(turns, convention or Convention(), seed)
