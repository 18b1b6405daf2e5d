"""Training on several devices, as torchrun starts it: two processes on the CPU hold one and the same network."""

import json
import os
import subprocess
import sys

import pytest
from worlds import street, write_bins

from automos.core.label_files import pack
from automos.core.pose_writers import write_kitti

pytestmark = pytest.mark.slow

for package in ("torch", "pytorch_lightning", "torchmetrics"):
    pytest.importorskip(package, reason="training needs PyTorch and Lightning: pip install '.[train]'")

SCRIPT = """
import hashlib, json, os, sys
from pathlib import Path
import torch
from automos.network.recordings import Source
from automos.network.train import TrainingData, train
from automos.settings import load_settings

root = Path(sys.argv[1])
image = {"network.image.height": 16, "network.image.width": 128, "network.image.residuals": 3}
training = {"network.training.batch": 2, "network.training.epochs": 2, "network.model.channels": 4}
chosen = load_settings("default", overrides={**image, **training, "odometry.time": "none"})
train(TrainingData((Source(root / "street"),)), root / "net", chosen, device="cpu", devices=2)
digest = hashlib.sha256()
network = torch.load(root / "net" / "last.ckpt", map_location="cpu", weights_only=True)["state_dict"]
for name in sorted(network):
    digest.update(network[name].numpy().tobytes())
rank, world = os.environ["RANK"], os.environ["WORLD_SIZE"]
(root / f"rank{rank}.json").write_text(json.dumps({"world": world, "weights": digest.hexdigest()}))
"""


def test_two_processes_started_by_torchrun_train_one_network(tmp_path):
    world, recording = street(8), tmp_path / "street"
    write_bins(world.sequence, recording / "velodyne")
    write_kitti(recording / "poses.txt", world.poses)
    (recording / "labels").mkdir()
    for name, truth in zip(world.sequence.names, world.truth, strict=True):
        pack(truth).tofile(recording / "labels" / f"{name}.label")
    (tmp_path / "train.py").write_text(SCRIPT)
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    run = subprocess.run(
        [*torchrun, str(tmp_path / "train.py"), str(tmp_path)],
        env=environment, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr[-3000:]
    ranks = [json.loads((tmp_path / f"rank{k}.json").read_text()) for k in range(2)]
    assert ranks[0] == ranks[1]
    assert ranks[0]["world"] == "2"
    assert (tmp_path / "net" / "best.pt").exists()
