"""The same world in other formats gets the same labels."""

import numpy as np
import pytest
from typer.testing import CliRunner
from worlds import lane, write_bins

from automos.cli import app
from automos.core.labels import Label

bags = pytest.importorskip("bags")


def labels_of(recording, out):
    """Return the bytes of all label files that one command makes of `recording`."""
    run = CliRunner().invoke(app, ["label", str(recording), "--out", str(out), "--workers", "1"])
    assert run.exit_code == 0, run.output
    return {path.name: path.read_bytes() for path in (out / "predictions").iterdir()}


def test_a_world_written_as_mcap_gets_the_labels_it_gets_in_kittis_layout(tmp_path):
    world = lane()
    write_bins(world.sequence, tmp_path / "kitti" / "velodyne")
    stamps = [scan.stamp for scan in world.sequence]
    (tmp_path / "kitti" / "times.txt").write_text("".join(f"{stamp:.9f}\n" for stamp in stamps))
    messages = []
    for scan in world.sequence:
        columns = {axis: scan.points[:, k] for k, axis in enumerate("xyz")} | {"intensity": np.zeros(len(scan), "f4")}
        messages.append((round(1e9 * scan.stamp), scan.stamp, bags.cloud(columns)))
    bags.write_bag(tmp_path / "lane.mcap", {"/lidar/points": messages})

    from_kitti = labels_of(tmp_path / "kitti", tmp_path / "from_kitti")
    from_mcap = labels_of(tmp_path / "lane.mcap", tmp_path / "from_mcap")
    assert from_mcap == from_kitti
    moving = np.concatenate([np.frombuffer(raw, np.uint32) for raw in from_mcap.values()]) & 0xFFFF
    assert (moving == Label.MOVING).sum() > 100
