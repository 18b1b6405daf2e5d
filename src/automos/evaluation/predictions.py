"""Label files on disk: where those of a recording are, whether they are complete, and each point's track."""

import math
from contextlib import suppress
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.claims import RESULTS, held_by
from automos.core.errors import AutomosError, InputError
from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.core.workspace import COMPLETE, RESULT_FILES, REVIEWED, RUN_FILE, UNFINISHED, Workspace
from automos.settings import load_settings

ONLY_OURS = {"stages", *RESULT_FILES} - {"poses.txt"}
"""What shows that a run of ours began in a folder; poses.txt is in every sequence of the benchmark, too."""


def find_predictions(root: Path, name: str, is_only: bool) -> Path:
    """Return the folder of recording `name`'s label files; for a single recording (`is_only`), also `root`."""
    homes = [root / name, root / "sequences" / name]
    if is_only:
        homes.insert(0, root)
    for home in homes:
        for folder in (home / "predictions", home):
            if any(folder.glob("[!.]*.label")):
                _require_finished(home)
                return folder
    raise InputError(f"{root} holds no predictions for {name}; give a results folder, or a folder of .label files")


def _require_finished(folder: Path) -> None:
    """Raise InputError if `folder` is an unfinished run of ours; labels of other programs may be anywhere."""
    is_ours = held_by(folder) == RESULTS or any((folder / name).exists() for name in ONLY_OURS)
    in_fleet = (folder.parent / "ledger").is_dir()
    last = COMPLETE if in_fleet else RUN_FILE
    if (is_ours or in_fleet) and not (folder / last).exists():
        raise InputError(f"{folder} was not labelled to its end (it holds no {last}): run the same command again")
    run = Workspace(folder).read_run()
    if (is_ours or in_fleet) and not run:
        raise InputError(f"{folder / RUN_FILE} is missing or damaged: run the same command again")
    if run.get(UNFINISHED):
        raise InputError(f"{folder} is without decisions of its review, as its run was cut off: repeat automos label")


def says_what_moves_now(folder: Path) -> bool:
    """Return whether the label files in `folder` are of a run that says what moves in each scan, not what ever moved.

    What is labelled as scans come does so unless its settings say otherwise.
    """
    root = folder.parent if folder.name == "predictions" else folder
    run, path = Workspace(root).read_run(), root / "settings.yaml"
    if not run or not path.exists():
        return False
    with suppress(AutomosError):  # points are counted without settings, too
        lag = run.get("lag_seconds")
        usual = "sequence" if lag in (None, math.inf) else "now"
        return (load_settings("default", path).labels.moving or usual) == "now"
    return False


class StoredStages:
    """What the stages of a run keep; its run.json is read once.

    folder : a results folder, or the folder of its label files.
    """

    def __init__(self, folder: Path):
        self._root = folder.parent if folder.name == "predictions" else folder
        self._keys: dict[str, str] = Workspace(self._root).read_run().get("stages", {})

    def load(self, stage: str, name: str, *what: str) -> dict[str, npt.NDArray] | None:
        """Return the arrays `what` (all, where none is named) kept as `name`; None where there is no such file."""
        key = str(self._keys.get("labels" if stage == REVIEWED else stage))
        if not (self._root / "stages" / f"{stage}-{key}" / f"{name}.npz").exists():
            return None
        return Workspace(self._root).stage(stage, key).load(name, *what)

    def of_points(self, name: str, what: str) -> npt.NDArray | None:
        """Return `what` (N,) a person decided of scan `name`, where anything was, else what the run found; or None."""
        found = self.load(REVIEWED, name, what) or self.load("labels", name, what)
        return None if found is None else found[what]

    def tracks(self, name: str, packed: npt.NDArray[np.uint32]) -> npt.NDArray[np.int64] | None:
        """Return (N,) the id of the track that each moving point of scan `name` belongs to, 0 for none.

        packed : (N,) the scan's labels as in its label file. None where points move, and nothing says on which object.
        """
        is_moving = to_mos(packed) == Label.MOVING
        if (packed >> 16).any() or not is_moving.any():
            return (packed >> 16).astype(np.int64)
        tracks = self.of_points(name, "track")
        return None if tracks is None else np.where(is_moving, tracks.astype(np.int64) + 1, 0)
