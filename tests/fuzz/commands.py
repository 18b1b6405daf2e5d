"""Commands of the command line on results, recordings and side files that were damaged, and with hostile values.

What is damaged is a copy of a small recording, of the results made from it, and of what goes with them (corrections,
labels of another program, poses, settings, a log of decisions, the books of a fleet).
"""

import json
import random
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from calling import LAST, WrongError, call
from damage import NUMBERS, change, damage
from values import OPTIONS, WORDS, filled
from worlds import lane, write_bins

from automos.core.pose_writers import write_kitti
from automos.readers import open_recordings, open_sequence
from automos.results.open_run import open_run
from automos.settings import load_settings
from automos.writers import EXPORTS

N_SCANS = 12


def write_all(root: Path) -> None:
    """Write into `root` a recording, its results, and everything else that commands are given."""
    from automos.fleet.label import Resources, label_fleet
    from automos.fleet.sources import find_all
    from automos.labeling import label_recording
    from automos.review.session import Session
    from automos.writers import export_run

    world, log = lane(N_SCANS), root / "log"
    write_bins(world.sequence, log / "velodyne")
    (log / "labels").mkdir()
    for name, truth in zip(world.sequence.names, world.truth, strict=True):
        truth.astype("u4").tofile(log / "labels" / f"{name}.label")
    (log / "times.txt").write_text("".join(f"{stamp:.6f}\n" for stamp in world.sequence.stamps))
    write_kitti(log / "poses.txt", world.poses)
    (log / "calib.txt").write_text("Tr: 1 0 0 0 0 1 0 0 0 0 1 0\n")
    settings = load_settings("default", None, {"output.confidence": True})
    label_recording(open_sequence(log), root / "run", settings, workers=1)
    export_run(root / "run", open_recordings(log), "sustech", root / "boxes")
    shutil.copytree(root / "run" / "predictions", root / "labels")
    session = Session(open_run(root / "run"))
    session.decide([1], "static")
    session.propose(6, at=(0.0, 11.0))
    session.accept(0, N_SCANS - 1)
    session.close()
    for name in ("a", "b"):
        shutil.copytree(log, root / "logs" / name)
    label_fleet(find_all(str(root / "logs")), str(root / "fleet"), settings, Resources(workers=1, work=root / "work"))
    shutil.rmtree(root / "work", ignore_errors=True)


# -------------------------------------------------------------------------------------------------- what is checked
def _require_whole(folder: Path, log: Path) -> None:
    """Raise where `folder` passes for results though it has not a label for each point."""
    if not (folder / "run.json").exists():
        raise WrongError("a run ended well and left no run.json")
    for path in filter(Path.is_file, sorted((log / "velodyne").iterdir())):
        labels = folder / "predictions" / f"{path.stem}.label"
        if not labels.is_file() or labels.stat().st_size * 4 != path.stat().st_size:
            raise WrongError(f"{labels.name} has not a label for each point")


def _label(root: Path, rng: random.Random, *more: object) -> None:
    """Label again where results are, whatever became of these: they are whole then."""
    call("label", root / "log", "--out", root / "run", "--workers", 1, "--confidence", *more)
    _require_whole(root / "run", root / "log")


def _merge(root: Path, rng: random.Random, *more: object) -> None:
    corrected = rng.choice(("boxes", "labels"))
    call("merge", root / "run", root / "log", root / corrected, "--out", root / "merged", *more)
    if "--out" not in more:
        _require_whole(root / "merged", root / "log")


def _export(root: Path, rng: random.Random, *more: object) -> None:
    to, deskewed = rng.choice(EXPORTS), ["--deskewed"] * (rng.random() < 0.1)
    call("export", root / "run", root / "log", "--to", to, "--out", root / "out", *deskewed, *more)
    if not any((root / "out", *root.glob("out*"))):
        raise WrongError("nothing was written")


def _load(root: Path, rng: random.Random, *more: object) -> None:
    """Ask a result for all that it says, the recording given, found, or gone."""
    import automos

    gone = rng.random() < 0.2
    if gone:
        (root / "run" / "run.json").write_text((root / "run" / "run.json").read_text().replace("velodyne", "gone"))
    result = automos.load(root / "run", *([] if gone or rng.random() < 0.5 else [root / "log"]))
    if not (np.abs(result.trajectory.T_world_sensor) < 1e9).all():
        raise WrongError("poses that are nowhere")
    for found in result.objects:
        if not (0.0 <= found.p_moved <= 1.0 and np.isfinite(found.boxes.center).all() and len(found.moves)):
            raise WrongError("an object that is none")
    repr(result), result._repr_html_(), result.to_dataframe()
    points = result.points(rng.randrange(len(result)))
    for each in (points.confidence, points.object, points.flow if not gone else points.labels):
        if len(each) != len(points.labels):
            raise WrongError("more or fewer values than points")
    result.save(root / "saved")
    if not gone and not any("log/" in one for one in LAST):  # of a scan that was whole the labels stay
        _require_whole(root / "saved", root / "log")


def _clean(root: Path, rng: random.Random, *more: object) -> None:
    call("clean", root / "run", root / "log", "--out", root / "out", *more)


def _dataset(root: Path, rng: random.Random, *more: object) -> None:
    layout = rng.choice(("semantickitti", "helimos"))
    call("dataset", root / "run", "--recordings", root / "log", "--out", root / "out", "--layout", layout, *more)


def _review(root: Path, rng: random.Random, *more: object) -> None:
    """Open a review, look at everything once and decide; what was written must be whole."""
    from automos.review.session import Session

    session = Session(open_run(root / "run"))
    items = session.overview()["items"]
    for item in items[:2]:
        if "id" in item:
            session.scene(item["id"])
            session.decide([item["id"]], rng.choice(("moving", "static", "undo")))
    session.propose(N_SCANS // 2, (0.0, -11.0), is_glance=True)
    session.place(N_SCANS // 2)
    session.close()
    _require_whole(root / "run", root / "log")


def _status(root: Path, rng: random.Random, *more: object) -> None:
    call("status", root / "fleet", *["--json"] * (rng.random() < 0.5), *more)


def _fleet(root: Path, rng: random.Random, *more: object) -> None:
    markers = [root / "fleet" / name / "complete.json" for name in ("a", "b")]
    before = [marker.stat().st_mtime_ns if marker.is_file() else None for marker in markers]
    call(
        "label", root / "logs", "--out", root / "fleet", "--workers", 1, "--work", root / "work", "--confidence", *more
    )
    for marker, made in zip(markers, before, strict=True):
        # Those of a recording that is told to be damaged are there still, and whole for what it was.
        if marker.exists() and marker.stat().st_mtime_ns != made:
            _require_whole(marker.parent, root / "logs" / marker.parent.name)


Does = Callable[..., object]
COMMANDS: dict[str, tuple[Does, tuple[str, ...]]] = {
    "evaluate": (lambda root, rng, *more: call("evaluate", root / "run", root / "log", *more), ("run", "log")),
    "report": (lambda root, rng, *more: call("report", root / "run", root / "log", *more), ("run",)),
    "export": (_export, ("run",)),
    "merge": (_merge, ("boxes", "labels", "run")),
    "load": (_load, ("run", "run", "log")),
    "map": (lambda root, rng, *more: call("map", root / "run", "--out", root / "out", *more), ("run", "log")),
    "clean": (_clean, ("run", "log")),
    "dataset": (_dataset, ("run", "log")),
    "label again": (_label, ("run",)),
    "given poses": (lambda root, rng: _label(root, rng, "--poses", root / "log" / "poses.txt", "--overwrite",
                                             "--calib", root / "log" / "calib.txt"), ("log",)),
    "drift": (lambda root, rng, *more: call("drift", root / "run" / rng.choice(("poses.txt", "poses.tum")),
                                            root / "log" / "poses.txt", *more), ("run", "log")),
    "view": (lambda root, rng, *more: call("view", root / "run", root / "log", "--rrd", root / "v.rrd", *more),
             ("run",)),
    "review": (_review, ("run",)),
    "status": (_status, ("fleet",)),
    "fleet": (_fleet, ("fleet", "logs")),
}  # fmt: skip
"""What a command does with the files below a folder, and which of these are damaged before."""


def fuzz_command(kind: str, bases: Path, rng: random.Random, work: Path) -> None:
    """Damage what a command is given in one or two places, and run it."""
    does, parts = COMMANDS[kind]
    root, theirs = work / "case", work / "theirs"
    shutil.copytree(bases, root)
    before = _somebodys(theirs, root, rng)
    try:
        _damage_and_run(does, parts, kind, root, rng, ("--out", theirs) if rng.random() < 0.2 else ())
    finally:
        if {path: path.read_bytes() for path in before if path.is_file()} != before:
            raise WrongError("files of somebody else were replaced or deleted")


def _somebodys(theirs: Path, root: Path, rng: random.Random) -> dict[Path, bytes]:
    """Make a folder of somebody else's, to which folders of ours may lead, and return what is in it."""
    for name in ("train/train.py", "000003.label", "000003.npy", "run.json", "poses.txt", "labels-0/000003.npz"):
        (theirs / name).parent.mkdir(parents=True, exist_ok=True)
        (theirs / name).write_bytes(b"theirs")
    if rng.random() < 0.3:
        place = root / rng.choice(("run/predictions", "run/stages", "run/export", "merged", "out", "fleet/a"))
        shutil.rmtree(place, ignore_errors=True)
        place.symlink_to(theirs)
        LAST.append(f"{place.name} leads to somebody's")
    return {path: path.read_bytes() for path in theirs.rglob("*") if path.is_file()}


def _damage_and_run(
    does: Does, parts: tuple[str, ...], kind: str, root: Path, rng: random.Random, out: tuple[object, ...]
) -> None:
    if out and kind in ("export", "merge", "report", "map", "clean", "dataset"):
        LAST.append("--out somebody's")
        does(root, rng, *out)
        return
    part = root / rng.choice(parts)
    if rng.random() < 0.15 and kind in OPTIONS:
        more = (rng.choice(OPTIONS[kind]), filled(rng.choice(WORDS), root))
        LAST.append(str(more))
        does(root, rng, *more)
        return
    shallow = [part / name for name in ("tracks.json", "run.json", "poses.txt", "review.jsonl", "settings.yaml")]
    aimed = [path for path in shallow if path.is_file()]
    for _ in range(rng.choice((1, 1, 2))):
        only = rng.choice(aimed) if aimed and rng.random() < 0.6 else None
        LAST.append(f"{part.name}/{damage(part, rng, only)}")
    does(root, rng)


class Requests:
    """One review whose page says hostile things to it."""

    def __init__(self, bases: Path, work: Path):
        from automos.review.session import Session

        self.root = work / "requests"
        shutil.rmtree(self.root, ignore_errors=True)
        shutil.copytree(bases, self.root)
        self.session = Session(open_run(self.root / "run"), n_looks=10)

    def ask(self, rng: random.Random) -> None:
        """Say one thing with one value changed, or ask for something with a hostile number."""
        from automos.review.api import ASKED, SAID

        box = [3.0, 1.0, 4.0, 2.0, 0.1]
        bodies = {
            "decide": {"tracks": [1, 2], "verdict": "moving"}, "propose": {"index": 3, "x": 1.0, "y": 11.0},
            "accept": {"first": 0, "last": 5, "verdict": "moving"}, "cut": {"track": 1, "index": 4},
            "split": {"track": 1, "index": 4, "box": box}, "join": {"tracks": [1, 2]}, "dismiss": {"place": 0},
            "answer": {"look": 1, "answer": "moving"}, "missed": {"look": 1, "x": 1.0, "y": 11.0},
            "forget": {"look": 1},
        }  # fmt: skip
        if rng.random() < 0.3:
            bodies["propose"] = {"boxes": [{"index": 3, "box": box}, {"index": 6, "box": box}]}
        bodies["propose"]["glance"] = rng.random() < 0.5
        if rng.random() < 0.3:
            name, given = rng.choice(sorted(ASKED)), rng.choice(NUMBERS)
            LAST.append(f"{name} {given[:30]!r}")
            json.dumps(ASKED[name](self.session, {key: [given] for key in ("track", "look", "index")}))
        else:
            name = rng.choice(sorted(bodies))
            body = change(bodies[name], rng)
            LAST.append(f"{name} {str(body)[:300]}")
            if isinstance(body, dict):  # the server refuses others
                json.dumps(SAID[name](self.session, body))
        if self.session.writer.problem is not None:
            raise WrongError(f"what was decided cannot be written: {self.session.writer.problem}")
