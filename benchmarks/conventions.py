"""What recorders' conventions cost: labels of the same drives, cut, ordered and timed otherwise."""

from __future__ import annotations

from automos.simulation.recorders import Convention

OF_RECORDERS: dict[str, Convention] = {
    "plain": Convention(),
    "in time order": Convention(order="time"),
    "cut every 1.09 turns": Convention(turns=1.09, order="time"),
    "cut every 0.92 turns": Convention(turns=0.92, order="time"),
    "cut every 1.09 turns, no stamps": Convention(turns=1.09, order="time", stamps=False),
    "cut every 1.09 turns, relative times": Convention(turns=1.09, order="time", times="relative"),
    "every 7th scan lost, no stamps": Convention(leave_out=7, stamps=False),
    "every 10th scan twice, no stamps": Convention(double=10, stamps=False),
    "renumbered, no stamps": Convention(renumbered=True, stamps=False),
    "two scans merged": Convention(turns=2.0),
    "beam by beam": Convention(order="ring"),
    "shuffled": Convention(order="random"),
}
"""What a recorder may do, by name."""
