"""The process in which damaged inputs are read: a kind, a seed and the seconds of processor time that the input may
take come in on a line, the outcome goes out on one. Where the time is used up, the process ends by SIGPROF.

Outcomes: refused (one sentence that names where), accepted (as many points as there are), and what must not be:
traceback, wrong. A crash or a hang is seen by the process that waits.
"""

import json
import logging
import os
import random
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "live")]
warnings.simplefilter("ignore")
logging.disable(logging.CRITICAL)

import numpy as np
import yaml
from bases import write_all
from calling import LAST, WrongError
from commands import COMMANDS, Requests, fuzz_command
from commands import write_all as write_commands
from damage import NUMBERS, change, damage
from values import fuzz_list, fuzz_values

from automos.core.errors import AutomosError
from automos.core.geometry import is_rigid
from automos.core.pose_files import read_poses
from automos.fleet.sources import find_all
from automos.readers import open_recordings
from automos.settings import dump_yaml, load_settings, read_overrides
from automos.views.checking import check

_NO_SETTINGS = (
    "&a [*a]", "a: &a {b: *a}", "{" * 5000, "\x00", "2020-99-99: 1", "!!python/object:os.system {}",
    "[" + "1," * 5_000_000 + "]", "tracking: {max_misses: 1:30}", "tracking: {max_misses: 0b11}", "[" * 30_000,
)  # fmt: skip
MOST = {"ouster": 1024 * 128}
"""Points that a scan may have, where it is more than usual."""
MOST_OF_PACKETS = 4200 * 384
POSES = "1 0 0 0 0 1 0 0 0 0 1 0\n" * 4


def read_recordings(folder: Path, most: int | None) -> None:
    """Read all that a run, and an evaluation, would read of what is found in `folder`."""
    find_all(str(folder))
    for sequence in open_recordings(folder):
        if len(set(sequence.names)) != len(sequence):
            raise WrongError("two scans have one name")
        stamps = sequence.stamps
        if stamps is not None and not (np.isfinite(stamps).all() and (np.diff(stamps) > 0).all()):
            raise WrongError("times that do not increase")
        poses = sequence.reference_poses
        if poses is not None and not ((np.abs(poses) < 1e9).all() and is_rigid(poses).all()):
            raise WrongError("poses that are none, or nowhere")
        sequence.fingerprint()
        for i in range(len(sequence)):
            scan = sequence[i]
            scan.is_valid.sum()
            truth = sequence.truth(i)
            if truth is not None and len(truth) != len(scan):
                raise WrongError("labels of another number than points")
            if most is not None and len(scan) > most:
                raise WrongError(f"{len(scan)} points where there are {most} at most")


def fuzz_recording(kind: str, bases: dict[str, Path], rng: random.Random, work: Path) -> None:
    """Damage a recording in one or two places and read it."""
    folder = work / "case"
    shutil.copytree(bases[kind], folder)
    LAST.extend(damage(folder, rng) for _ in range(rng.choice((1, 1, 2))))
    if rng.random() < 0.1:
        for found in check(folder):
            found.lines()
    read_recordings(folder, MOST.get(kind, 70_000))


def fuzz_packets(rng: random.Random, work: Path) -> None:
    """Decode what a running sensor sends, some of it damaged, lost, twice, in another order, at odd times."""
    from room_packets import room_packets

    from automos.live.opening import VelodyneAssembler

    packets = [list(one) for one in room_packets(3)]
    for _ in range(rng.choice((1, 3, 30))):
        i, j = rng.randrange(len(packets)), rng.randrange(len(packets))
        match rng.choice(("byte", "cut", "lost", "twice", "swap", "time", "noise")):
            case "byte":
                payload = bytearray(packets[i][1])
                if payload:
                    payload[rng.randrange(len(payload))] = rng.randrange(256)
                packets[i][1] = bytes(payload)
            case "cut":
                packets[i][1] = packets[i][1][: rng.randrange(1300)]
            case "lost":
                del packets[min(i, j) : min(max(i, j), min(i, j) + 200)]
            case "twice":
                packets.insert(j, packets[i])
            case "swap":
                packets[i], packets[j] = packets[j], packets[i]
            case "time":
                packets[i][0] = rng.choice((0.0, -1.0, 1e18, packets[j][0]))
            case _:
                packets[i][1] = rng.randbytes(len(packets[i][1]))
        packets = packets or [[0.0, b""]]
    assembler, at_once = VelodyneAssembler(), rng.choice((1, 7, 128))
    scans = []
    for first in range(0, len(packets), at_once):
        some = packets[first : first + at_once]
        scans += assembler.add([payload for _, payload in some], [seconds for seconds, _ in some])[0]
    for scan in (*scans, *assembler.rest()):
        if len(scan) > MOST_OF_PACKETS or not np.isfinite(scan.stamp):
            raise WrongError(f"a scan of {len(scan)} points at {scan.stamp}")


def fuzz_settings(rng: random.Random, work: Path) -> None:
    """Read a settings file, or a value of the command line, with one thing changed."""
    if rng.random() < 0.5:
        tree = change(yaml.safe_load(dump_yaml(load_settings("default"))), rng)
        text = yaml.safe_dump(tree) if rng.random() < 0.8 else rng.choice(_NO_SETTINGS)
        (work / "s.yaml").write_text(text)
        load_settings("default", work / "s.yaml")
    else:
        keys = [line.split(":")[0].strip() for line in dump_yaml(load_settings("default")).splitlines()]
        item = f"{rng.choice(('odometry', 'candidates', 'x'))}.{rng.choice(keys)}={rng.choice((*NUMBERS, '[', '*a'))}"
        load_settings("default", None, read_overrides([item]))


def fuzz_poses(rng: random.Random, work: Path) -> None:
    words = POSES.split(" ")
    words[rng.randrange(len(words))] = rng.choice(NUMBERS)
    (work / "poses.txt").write_text(" ".join(words), errors="replace")
    poses = read_poses(work / "poses.txt", 4)
    if not (np.abs(poses[:, :3, 3]) < 1e9).all():
        raise WrongError("poses that are nowhere")


def fuzz_edits(rng: random.Random, work: Path, run: object) -> None:
    """Read corrections of another tool with one thing changed."""
    from automos.writers.edits import read_edits

    box = {"position": [1, 2, 3], "scale": [4, 2, 1], "rotation": [0, 0, 0.1], "label_id": 0, "type": "cuboid_3d",
           "attributes": {"track_id": 1}}  # fmt: skip
    item = {"id": run.names[0], "annotations": [box]}
    cvat = {"categories": {"label": {"labels": [{"name": "moving"}]}}, "items": [item]}
    psr = {key: dict(zip("xyz", box[key], strict=True)) for key in ("position", "scale", "rotation")}
    if rng.random() < 0.5:
        path = work / "edits.json"
        document = change(cvat, rng)
        path.write_text(json.dumps(document) if rng.random() < 0.95 else "[" * 100_000)
    else:
        path = work / "scene"
        (path / "label").mkdir(parents=True)
        document = change([{"obj_id": "1", "obj_type": "moving", "psr": psr}], rng)
        (path / "label" / f"{run.names[0]}.json").write_text(json.dumps(document))
    for scan in read_edits(path, run).values():
        for edited in scan.values():
            if not np.isfinite([*edited.center, *edited.size, edited.yaw]).all():
                raise WrongError("a box that is nowhere")


def fuzz_label(rng: random.Random, work: Path) -> None:
    """Label a recording of hostile points to its end; every point has one label."""
    from automos.labeling import label_recording

    folder = work / "log"
    folder.mkdir()
    n, kept = rng.choice((1, 60, 400)), np.random.default_rng(rng.randrange(1 << 30))
    for i in range(rng.choice((1, 3, 6))):
        points = kept.normal(0.0, 10.0, (n, 4)).astype(np.float32)
        if rng.random() < 0.3:
            points[:, rng.choice((slice(0, 2), slice(1, 3), slice(0, 3)))] = rng.choice((0.0, 5.0))
        bad = kept.random((n, 4)) < rng.choice((0.0, 0.05, 1.0))
        points[bad] = kept.choice(np.array([np.nan, np.inf, 5e18, 1.7e19, 3e38, 1e5, 0.0], np.float32), bad.sum())
        points.tofile(folder / f"{i:06d}.bin")
    preset = rng.choice(("default", "paper"))
    label_recording(open_recordings(folder)[0], work / "out", load_settings(preset), workers=1)
    for path in folder.iterdir():
        if (work / "out" / "predictions" / f"{path.stem}.label").stat().st_size * 4 != path.stat().st_size:
            raise WrongError("labels of another number than points")


class Kinds:
    """What reads damaged inputs of each kind; what they need beside is written when first asked for."""

    def __init__(self, root: Path):
        self._root, self._requests = root, None
        self._bases = write_all(root / "bases")
        self._own = {
            "settings": fuzz_settings, "packets": fuzz_packets, "poses": fuzz_poses, "edits": self._edits,
            "label": fuzz_label, "values": self._values, "list": self._list, "requests": self._ask,
            **dict.fromkeys(COMMANDS, self._command),
        }  # fmt: skip
        self.names = [*sorted(self._bases), *self._own]

    def read(self, kind: str, rng: random.Random, work: Path) -> None:
        """Make an input of `kind` and have it read."""
        LAST.clear()
        if kind in self._bases:
            fuzz_recording(kind, self._bases, rng, work)
        elif kind in COMMANDS:
            self._command(kind, rng, work)
        else:
            self._own[kind](rng, work)

    def prepare(self, kind: str) -> None:
        """Make what inputs of `kind` are made from, which takes long the first time."""
        if kind in COMMANDS or kind in ("values", "list", "requests"):
            self._commands()

    def _commands(self) -> Path:
        if not (self._root / "commands").exists():
            write_commands(self._root / "commands")
        return self._root / "commands"

    def _command(self, kind: str, rng: random.Random, work: Path) -> None:
        fuzz_command(kind, self._commands(), rng, work)

    def _values(self, rng: random.Random, work: Path) -> None:
        fuzz_values(self._commands(), rng, work)

    def _list(self, rng: random.Random, work: Path) -> None:
        fuzz_list(self._commands(), rng, work)

    def _ask(self, rng: random.Random, work: Path) -> None:
        self._requests = self._requests or Requests(self._commands(), self._root)
        self._requests.ask(rng)

    def _edits(self, rng: random.Random, work: Path) -> None:
        sys.path.insert(0, str(Path(__file__).parents[1] / "writers"))
        from made_run import make_run

        fuzz_edits(rng, work, make_run(work / "run"))


def main() -> None:
    """Do as the lines of standard input say until they end."""
    said = sys.stdout
    root = Path(tempfile.mkdtemp(prefix="automos-fuzz-"))
    os.chdir(root)  # what is written where one stands is removed with it
    kinds = Kinds(root)
    print(json.dumps(kinds.names), file=said, flush=True)
    for line in sys.stdin:
        kind, seed, seconds = line.rstrip("\n").rsplit(" ", 2)
        kinds.prepare(kind)
        signal.setitimer(signal.ITIMER_PROF, float(seconds))
        rng, work = random.Random(f"{kind} {seed}"), Path(tempfile.mkdtemp(dir=root))
        outcome, why = "accepted", ""
        try:
            kinds.read(kind, rng, work)
        except AutomosError as error:
            outcome, why = "refused", str(error)
            if len(why.split()) < 4:  # not a sentence; a name may hold a newline, which the command line replaces
                outcome = "wrong"
        except WrongError as error:
            outcome, why = "wrong", f"{error} {LAST}"
        except BaseException:
            outcome, why = "traceback", f"{traceback.format_exc(limit=-3)} {LAST}"
        shutil.rmtree(work, ignore_errors=True)
        print(json.dumps([outcome, why], default=str), file=said, flush=True)
    shutil.rmtree(root, ignore_errors=True)


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
