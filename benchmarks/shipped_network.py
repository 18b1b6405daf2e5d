"""How the network that comes along does on a recording with truth that it was not trained on: all points, online.

python benchmarks/shipped_network.py RECORDING [--weights FILE] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from rich.console import Console
from scores import ratios_of

from automos import load_settings, open_sequence
from automos.core.progress import StageProgress
from automos.evaluation.report import evaluate_folder
from automos.network.segment import open_network, segment_recording


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--weights", type=Path, help="default: the network that came along")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    sequence, network = open_sequence(arguments.recording), open_network(arguments.weights)
    with tempfile.TemporaryDirectory() as folder, StageProgress(Console(stderr=True), sequence.name) as progress:
        run = Path(folder) / "run"
        segment_recording(sequence, run, network, load_settings("default"), progress=progress)
        counts = evaluate_folder(run / "predictions", sequence).counts
    row = {"recording": sequence.name, "engine": network.engine} | ratios_of(counts)
    Console().print(row)
    if arguments.json:
        arguments.json.write_text(json.dumps(row, indent=1))


if __name__ == "__main__":
    main()
