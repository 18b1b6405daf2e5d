"""How recorders keep what a sensor measured: where they cut, in what order, with which times and numbers."""

from automos.simulation.recorders.convention import Convention
from automos.simulation.recorders.recorded import Recorded
from automos.simulation.recorders.write import write_recorded
