"""Loads our exports with the loaders of trainers, each from a copy of its repository; nothing of these is kept here.

    python benchmarks/consumers/loaders.py LOADER REPOSITORIES EXPORTS

Runs with PyTorch, h5py and SciPy, without automos. REPOSITORIES holds the clones by name: 4DMOS, MapMOS, LiDAR-MOS,
MotionSeg3D, MF-MOS, InsMOS, OpenSceneFlow. EXPORTS holds `helimos`, `semantickitti` (with --residuals 1-8 --boxes) and
`opensceneflow`, as `benchmarks/consumers/table.py` writes them. What the loaders import and do not need for reading
(open3d, spconv) is replaced by nothing.
"""

import importlib.util
import inspect
import json
import os
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType
from unittest.mock import MagicMock

import numpy as np
import yaml


def module_of(path: Path, name: str) -> ModuleType:
    """Import one file."""
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def manifest(root: Path) -> dict:
    """Return the scans of each sequence as we wrote them, by its number and by its folder."""
    return json.loads((root / "dataset.json").read_text())


def helimos(repository: Path, package: str, exports: Path) -> str:
    """4DMOS and MapMOS: every scan of every sequence that the configuration names, moving points counted."""
    root, n_scans = exports / "helimos", 0
    read = module_of(repository / "src" / package / "datasets" / "helimos.py", f"helimos_{package}").HeliMOSDataset
    named = yaml.safe_load((root / "mos4d.yaml").read_text())["training"]
    for sequence in [*named["train"], *named["val"]]:
        scans, wanted = read(str(root), sequence), manifest(root)["sequences"][sequence.split("/")[0]]["scans"]
        assert len(scans) == len(wanted), f"{len(scans)} scans, not {len(wanted)}"
        for k, scan in enumerate(wanted):
            points, _, labels = scans[k]
            assert (len(points), int((labels == 1).sum())) == (scan["points"], scan["moving"]), f"{sequence}, scan {k}"
        n_scans += len(wanted)
    return f"{n_scans} scans, moving points as written"


def kitti(repository: Path, package: str, exports: Path) -> str:
    """4DMOS and MapMOS by their loader of SemanticKITTI."""
    root, n_scans = exports / "semantickitti", 0
    module = module_of(repository / "src" / package / "datasets" / "kitti.py", f"kitti_{package}")
    for folder, sequence in manifest(root)["sequences"].items():
        scans = module.SemanticKITTIDataset(root, folder.split("/")[-1])
        assert len(scans) == len(sequence["scans"])
        for k, scan in enumerate(sequence["scans"]):
            points, *_, labels = scans[k]
            assert (len(points), int((labels == 1).sum())) == (scan["points"], scan["moving"]), f"{folder}, scan {k}"
        n_scans += len(scans)
    return f"{n_scans} scans, moving points as written"


def range_images(package: Path, exports: Path) -> str:
    """LiDAR-MOS, MotionSeg3D and MF-MOS: images of every seventh scan, classes of its points counted."""
    tasks, name = package / "tasks" / "semantic", "common.dataset.kitti.parser"
    sys.path[:0] = [str(package), str(tasks)]
    if tasks.is_dir():
        name = "tasks.semantic.dataset.kitti.parser"
        os.chdir(tasks)  # where LiDAR-MOS is run: it puts "../../" before all folders of modules
    loader = importlib.import_module(name).SemanticKitti
    root, said, n_scans = exports / "semantickitti", manifest(exports / "semantickitti"), 0
    for classes_file in sorted(root.glob("semantic-kitti-mos*.yaml")):
        suffix = classes_file.stem.removeprefix("semantic-kitti-mos")
        classes = yaml.safe_load(classes_file.read_text())
        arch = yaml.safe_load((root / f"sensor{suffix}.yaml").read_text())["dataset"]
        given = {**classes, "root": str(root), "max_points": arch["max_points"], "gt": True, "residual_aug": False}
        given["sensor"] = {**arch["sensor"], "n_input_scans": 1, "residual": True, "transform": False}
        wanted = inspect.signature(loader.__init__).parameters
        for number in [n for split in ("train", "valid") for n in classes["split"][split]]:
            scans = loader(**{key: value for key, value in {**given, "sequences": [number]}.items() if key in wanted})
            written = said["sequences"][f"sequences/{number}"]["scans"]
            assert len(scans) == len(written)
            for k in range(0, len(scans), 7):
                found = scans[k]
                height = arch["sensor"]["img_prop"]["height"]
                assert found[0].shape[1:] == (height, 2048), found[0].shape
                assert np.isfinite(found[0].numpy()).all()
                per_point = next(t for t in found if getattr(t, "ndim", 0) == 1 and len(t) >= written[k]["points"])
                n_moving = int((per_point[: written[k]["points"]] == 2).sum())
                assert n_moving == written[k]["moving"], f"{n_moving} points move, not {written[k]['moving']}"
                n_scans += 1
    return f"{n_scans} images with residuals, moving points as written"


def insmos(repository: Path, exports: Path) -> str:
    """InsMOS: ten scans each, in the frame of the last, with boxes."""
    sys.modules |= dict.fromkeys(("spconv", "spconv.pytorch", "spconv.pytorch.utils"), MagicMock())
    sys.path.insert(0, str(repository))
    loader = importlib.import_module("dataloader.datasets").KittiSequentialDataset
    root, n_samples, n_boxes = exports / "semantickitti", 0, 0
    os.environ["DATA"] = str(root / "sequences")
    config = yaml.safe_load((repository / "config" / "config.yaml").read_text())
    config["DATA"]["SEMANTIC_CONFIG_FILE"] = str(repository / "config" / "semantic-kitti-mos.yaml")
    for splits in sorted(root.glob("insmos*.yaml")):
        config["DATA"]["SPLIT"] = yaml.safe_load(splits.read_text())["DATA"]["SPLIT"]
        for split in ("train", "val"):
            samples = loader(config, split)
            for k in range(0, len(samples), 20):
                item = samples[k]
                boxes = next(v for key, v in item.items() if "box" in key) if isinstance(item, dict) else item[3]
                n_boxes += len(boxes)
                n_samples += 1
    assert n_boxes > 0
    return f"{n_samples} samples of ten scans, {n_boxes} boxes"


def opensceneflow(repository: Path, exports: Path) -> str:
    """OpenSceneFlow: pairs for supervised and, with clusters, for self-supervised training."""
    sys.path.insert(0, str(repository))
    loader = importlib.import_module("src.dataset").HDF5Dataset
    root, found = exports / "opensceneflow", Counter()
    for label in (None, "seflow_auto"):
        pairs = loader(str(root), n_frames=2, ssl_label=label)
        for k in range(0, len(pairs) - 1, 7):
            item = pairs[k]
            assert len(item["pc0"]) == len(item["gm0"])
            assert item["gm0"].dtype == bool
            if label is None:
                assert len(item["flow"]) == len(item["pc0"])
                found["pairs"] += 1
            else:
                found["points that move"] += int((item["pc0_dynamic"] > 0).sum())
    assert found["points that move"] > 0
    return ", ".join(f"{count} {what}" for what, count in found.items())


def main() -> None:
    """Run one loader and say what it read."""
    name, repositories, exports = sys.argv[1], Path(sys.argv[2]).absolute(), Path(sys.argv[3]).absolute()
    for kind in (float, int, bool):  # they use np.float and the like, which NumPy no longer has, or has as its own
        if not hasattr(np, kind.__name__):
            setattr(np, kind.__name__, kind)
    sys.modules["open3d"] = MagicMock()
    loaders = {
        "4DMOS helimos": lambda: helimos(repositories / "4DMOS", "mos4d", exports),
        "MapMOS helimos": lambda: helimos(repositories / "MapMOS", "mapmos", exports),
        "4DMOS kitti": lambda: kitti(repositories / "4DMOS", "mos4d", exports),
        "MapMOS kitti": lambda: kitti(repositories / "MapMOS", "mapmos", exports),
        "LiDAR-MOS": lambda: range_images(repositories / "LiDAR-MOS" / "mos_SalsaNext" / "train", exports),
        "MotionSeg3D": lambda: range_images(repositories / "MotionSeg3D", exports),
        "MF-MOS": lambda: range_images(repositories / "MF-MOS", exports),
        "InsMOS": lambda: insmos(repositories / "InsMOS", exports),
        "OpenSceneFlow": lambda: opensceneflow(repositories / "OpenSceneFlow", exports),
    }
    sys.stdout, out = sys.stderr, sys.stdout
    print(loaders[name](), file=out)


if __name__ == "__main__":
    main()
