"""A recording of raw sweeps, one turn each, as another recorder would have kept it: cut anywhere, ordered, timed.

    python benchmarks/recut.py RECORDING OUT [--turns 1.09] [--order time] [--times none] [--no-stamps]
                               [--leave-out 7] [--double 10] [--renumbered] [--lost-packets 0.01] ...

Sweeps are taken for turns of a spinning sensor that begin at the azimuth --seam (degrees) and go --turning (-1:
clockwise); KITTI's HDL-64E begins at the back and turns clockwise. Labels and poses are carried along. OUT is in
KITTI's layout, .npy files where points have times. --turns 2 merges two sweeps into one.
"""

from __future__ import annotations

import argparse
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args, get_type_hints

from automos import open_sequence
from automos.simulation.recorders import Convention, Recorded, TurnsByAzimuth, write_recorded


def add_conventions(parser: argparse.ArgumentParser) -> None:
    """Add an option to `parser` for every field of a convention."""
    hints = get_type_hints(Convention)
    for field in fields(Convention):
        name, kind = f"--{field.name.replace('_', '-')}", hints[field.name]
        options: dict[str, Any] = {"default": field.default, "dest": field.name}
        if kind is bool:
            options["action"] = argparse.BooleanOptionalAction
        elif get_args(kind):
            options["choices"] = get_args(kind)
        else:
            options["type"] = kind
        parser.add_argument(name, **options)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--turning", type=int, choices=(-1, 1), default=-1)
    parser.add_argument("--seam", type=float, default=180.0)
    add_conventions(parser)
    arguments = parser.parse_args()
    convention = Convention(**{field.name: getattr(arguments, field.name) for field in fields(Convention)})
    turns = TurnsByAzimuth(open_sequence(arguments.recording), arguments.turning, arguments.seam)
    recorded = Recorded(turns, convention)
    write_recorded(recorded, arguments.out)
    print(f"{len(recorded)} scans in {arguments.out} ({convention})")


if __name__ == "__main__":
    main()
