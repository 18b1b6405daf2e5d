"""Out to a tool, corrected, and back."""

import json
import shutil
import zipfile

import numpy as np
import pytest
from typer.testing import CliRunner
from worlds import lane, write_bins

from automos.cli import app
from automos.core.errors import InputError
from automos.core.labels import Label
from automos.readers import open_sequence
from automos.readers.codecs import read_columns
from automos.results.run_files import RunFiles
from automos.writers import export_run
from automos.writers.edits import read_edits
from automos.writers.merge import merge

TOOLS = ("sustech", "cvat")


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """Return a folder with a labelled recording (`run` of `lane`), and it as scene and task."""
    root = tmp_path_factory.mktemp("merge")
    write_bins(lane().sequence, root / "lane")
    done = CliRunner().invoke(app, ["label", str(root / "lane"), "--out", str(root / "run"), "--workers", "1"])
    assert done.exit_code == 0, done.output
    for tool in TOOLS:
        export_run(root / "run", [open_sequence(root / "lane")], tool, root / tool)
    return root


@pytest.fixture
def run(root):
    return RunFiles(root / "run", open_sequence(root / "lane"))


class Scene:
    """A tool's boxes, to be changed: a list of boxes for every scan, and their class and id under one name."""

    def __init__(self, tool, root, tmp_path):
        self.tool, self.path = tool, tmp_path / tool
        shutil.copytree(root / tool, self.path)
        if tool == "cvat":
            self._document = json.loads((self.path / "annotations" / "default.json").read_text())
            self._names = [label["name"] for label in self._document["categories"]["label"]["labels"]]
            self.scans = [item["annotations"] for item in self._document["items"]]
        else:
            self._files = sorted((self.path / "label").glob("*.json"))
            self.scans = [json.loads(file.read_text()) for file in self._files]

    def id_of(self, box):
        return box["attributes"]["track_id"] if self.tool == "cvat" else int(box["obj_id"])

    def set_class(self, box, name):
        if self.tool == "cvat":
            box["label_id"] = self._names.index(name)
        else:
            box["obj_type"] = name

    def shift(self, box, x):
        if self.tool == "cvat":
            box["position"][0] += x
        else:
            box["psr"]["position"]["x"] += x

    def save(self):
        """Write the boxes as the tool does: CVAT numbers its tracks anew, and gives a zip."""
        if self.tool == "sustech":
            for file, boxes in zip(self._files, self.scans, strict=True):
                file.write_text(json.dumps(boxes))
            return self.path
        for boxes in self.scans:
            for box in boxes:
                box["attributes"]["track_id"] = 1000 - box["attributes"]["track_id"]
        return pack_as_cvat(self)


def pack_as_cvat(scene):
    """Write the boxes of a scene from CVAT as they are."""
    with zipfile.ZipFile(scene.path / "export.zip", "w") as archive:
        archive.writestr("annotations/default.json", json.dumps(scene._document))
    return scene.path / "export.zip"


@pytest.fixture(params=TOOLS)
def scene(request, root, tmp_path):
    return Scene(request.param, root, tmp_path)


def moving_track(run):
    """Return the moving track with most boxes."""
    moving = [t for t in run.tracks_file["tracks"] if t["verdict"] == "moving"]
    return max(moving, key=lambda track: len(track["boxes"]))["id"]


def labels_of(run, index):
    return run.labels(index, len(run.scan(index)))


def test_what_nobody_changed_comes_back_as_it_was(run, scene, tmp_path):
    merged = merge(run, scene.save(), tmp_path / "out")
    n_boxes = sum(len(run.boxes_upright(i)) for i in range(len(run)))
    assert dict(merged.boxes) == {"unchanged": n_boxes}
    assert (dict(merged.points), merged.scans) == ({}, 0)
    again = RunFiles(tmp_path / "out", run.sequence)
    for i in range(len(run)):
        np.testing.assert_array_equal(labels_of(again, i), labels_of(run, i))
        n = len(run.scan(i))
        np.testing.assert_array_equal(again.instances(i, n), run.instances(i, n))
    assert again.tracks_file == run.tracks_file


def flatten(folder, width):
    """Make every box of a results folder `width` metres thin."""
    told = json.loads((folder / "tracks.json").read_text())
    for track in told["tracks"]:
        for box in track["boxes"]:
            box["size"][1] = width
    (folder / "tracks.json").write_text(json.dumps(told))


@pytest.mark.parametrize("width", [None, 0.003], ids=["as found", "flat"])
def test_cvats_own_library_gives_back_what_it_was_given(root, tmp_path, width):
    datumaro = pytest.importorskip("datumaro", reason="CVAT's library is not installed: pip install '.[dev-readers]'")
    shutil.copytree(root / "run", tmp_path / "run")
    if width is not None:
        flatten(tmp_path / "run", width)
    run = RunFiles(tmp_path / "run", open_sequence(root / "lane"))
    export_run(run.folder, [run.sequence], "cvat", tmp_path / "task")
    read = datumaro.Dataset.import_from(str(tmp_path / "task"), "datumaro")
    read.export(str(tmp_path / "back"), "datumaro", save_media=False)
    merged = merge(run, tmp_path / "back", tmp_path / "out")
    assert dict(merged.boxes) == {"unchanged": sum(len(run.boxes_upright(i)) for i in range(len(run)))}
    assert (dict(merged.points), merged.scans) == ({}, 0)


def test_boxes_that_a_tool_made_flat_are_taken(run, root, tmp_path):
    scene = Scene("sustech", root, tmp_path)
    wide = next(box for boxes in scene.scans for box in boxes if box["psr"]["scale"]["y"] > 0.1)
    wide["psr"]["scale"]["y"] = 0.0
    assert merge(run, scene.save(), tmp_path / "out").boxes["moved"] == 1


def test_a_track_called_static_stops_moving_in_all_its_scans(run, scene, tmp_path):
    track = moving_track(run)
    boxes = [box for scan in scene.scans for box in scan if scene.id_of(box) == track]
    for box in boxes:
        scene.set_class(box, "static")
    merged = merge(run, scene.save(), tmp_path / "out")
    theirs = [run.instances(i, len(run.scan(i))) == track for i in range(len(run))]
    n_points = sum(int(mask.sum()) for mask in theirs)
    assert n_points > 50
    assert merged.boxes["verdict"] == len(boxes)
    assert merged.points["moving to static"] >= n_points
    again = RunFiles(tmp_path / "out", run.sequence)
    for i, mask in enumerate(theirs):
        assert (labels_of(again, i)[mask] == Label.STATIC).all()
    assert again.tracks[track] == ("static", 1.0)
    others = {key: value for key, value in run.tracks.items() if key != track}
    assert {key: again.tracks[key] for key in others} == others


def test_a_box_that_was_removed_or_moved_away_gives_its_points_back(run, scene, tmp_path):
    track = moving_track(run)
    scans = [i for i, scan in enumerate(scene.scans) if any(scene.id_of(box) == track for box in scan)]
    first, second = (next(i for i in part if (run.instances(i, len(run.scan(i))) == track).any())
                     for part in (scans, scans[::-1]))  # fmt: skip
    scene.scans[first][:] = [box for box in scene.scans[first] if scene.id_of(box) != track]
    scene.shift(next(box for box in scene.scans[second] if scene.id_of(box) == track), 200.0)
    merged = merge(run, scene.save(), tmp_path / "out")
    # CVAT's tracks are known by where most of their boxes are, so the one that was moved away is known as well
    assert (merged.boxes["removed"], merged.boxes["moved"], merged.scans) == (1, 1, 2)
    again = RunFiles(tmp_path / "out", run.sequence)
    for i in (first, second):
        mask = run.instances(i, len(run.scan(i))) == track
        assert (labels_of(again, i)[mask] == Label.STATIC).all()
    # read back, the box is where it was put: 200 m along the scan's own heading
    before, after = (r.boxes_upright(second) for r in (run, again))
    moved = after.boxes.center[after.ids == track] - before.boxes.center[before.ids == track]
    np.testing.assert_allclose(moved, [[200.0, 0.0, 0.0]], atol=2e-3)


def test_a_box_that_was_added_makes_its_points_move(run, root, tmp_path):
    scene = Scene("sustech", root, tmp_path)
    scan = run.scan(4)
    points = run.points_upright(scan, 4)
    ahead = int(np.argmax((labels_of(run, 4) == Label.STATIC) & (points[:, 2] > 0.5)))
    center = dict(zip("xyz", points[ahead].tolist(), strict=True))
    box = {"position": center, "scale": {"x": 1.0, "y": 1.0, "z": 1.0}, "rotation": {"x": 0, "y": 0, "z": 0}}
    scene.scans[4].append({"psr": box, "obj_type": "moving", "obj_id": ""})
    merged = merge(run, scene.save(), tmp_path / "out")
    again = RunFiles(tmp_path / "out", run.sequence)
    new = max(run.tracks) + 1
    assert merged.boxes["added"] == 1
    assert labels_of(again, 4)[ahead] == Label.MOVING
    assert again.instances(4, len(scan))[ahead] == new
    assert again.tracks[new] == ("moving", 1.0)
    assert merged.points["static to moving"] == (again.instances(4, len(scan)) == new).sum()


def test_boxes_whose_id_is_null_are_objects_of_their_own(run, root, tmp_path):
    scene, at = Scene("sustech", root, tmp_path), dict.fromkeys("xyz", 9.0)
    box = {"position": at, "scale": at, "rotation": dict.fromkeys("xyz", 0.0)}
    for scan in (2, 3):
        scene.scans[scan].append({"psr": box, "obj_type": "static", "obj_id": None})
    merge(run, scene.save(), tmp_path / "out")
    again = RunFiles(tmp_path / "out", run.sequence)
    assert len(set(again.tracks) - set(run.tracks)) == 2


def test_an_id_of_too_many_digits_is_told_with_its_file(run, root, tmp_path):
    scene = Scene("sustech", root, tmp_path)
    next(boxes for boxes in scene.scans if boxes)[0]["obj_id"] = "9" * 30
    with pytest.raises(InputError, match=r"\.json has a box with obj_id 99999999999999999999\.\.\.; ids have up to"):
        merge(run, scene.save(), tmp_path / "out")


def test_objects_with_names_never_share_a_number_with_one_that_was_numbered_by_hand(run, root, tmp_path):
    scene, taken = Scene("sustech", root, tmp_path), str(max(run.tracks) + 1)
    at = dict.fromkeys("xyz", 9.0)
    box = {"position": at, "scale": at, "rotation": dict.fromkeys("xyz", 0.0)}
    for scan, name in ((2, "a van"), (3, taken), (4, "a van")):
        scene.scans[scan].append({"psr": box, "obj_type": "static", "obj_id": name})
    edits = read_edits(scene.save(), run)
    (second,), (third,), (fourth,) = (edits[scan].keys() - run.tracks.keys() for scan in (2, 3, 4))
    assert third == int(taken)
    assert second == fourth != third


def test_corrected_labels_replace_those_of_their_scans(run, tmp_path):
    packed = run.packed(3, len(run.scan(3))).copy()
    packed[:10] = [10, 40, 252 | 9 << 16, 251, 0, 1, 99, 259, 9, 71]
    (tmp_path / "labels").mkdir()
    packed.tofile(tmp_path / "labels" / f"{run.names[3]}.label")
    merged = merge(run, tmp_path / "labels", tmp_path / "out")
    again = RunFiles(tmp_path / "out", run.sequence)
    assert labels_of(again, 3)[:10].tolist() == [9, 9, 251, 251, 0, 0, 9, 251, 9, 9]
    assert merged.scans == 1
    assert sum(merged.points.values()) == (labels_of(again, 3) != labels_of(run, 3)).sum()
    np.testing.assert_array_equal(labels_of(again, 2), labels_of(run, 2))
    packed[:-1].tofile(tmp_path / "labels" / f"{run.names[3]}.label")
    with pytest.raises(InputError, match=r"label holds \d+ labels, but its scan has \d+ points"):
        merge(run, tmp_path / "labels", tmp_path / "out")


def test_the_command_counts_what_changed_and_leaves_the_run_as_it_is(run, scene, tmp_path):
    before = {path.name: path.read_bytes() for path in (run.folder / "predictions").iterdir()}
    track = moving_track(run)
    for boxes in scene.scans:
        boxes[:] = [box for box in boxes if scene.id_of(box) != track]
    words = ["merge", run.folder, run.sequence.source, scene.save(), "--out", tmp_path / "out"]
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == 0, done.output
    assert "removed" in done.output
    assert "moving to static" in done.output
    assert {path.name: path.read_bytes() for path in (run.folder / "predictions").iterdir()} == before
    told = json.loads((tmp_path / "out" / "merge.json").read_text())
    assert told["points"]["moving to static"] > 50


def test_what_run_json_counts_is_what_was_merged(run, root, tmp_path):
    scene, track = Scene("sustech", root, tmp_path), moving_track(run)
    for boxes in scene.scans:
        boxes[:] = [box for box in boxes if scene.id_of(box) != track]
    merge(run, scene.save(), tmp_path / "out")
    before, after = (json.loads((folder / "run.json").read_text()) for folder in (run.folder, tmp_path / "out"))
    again = RunFiles(tmp_path / "out", run.sequence)
    labels = np.concatenate([labels_of(again, i) for i in range(len(run))])
    assert after["points"] == {label.name.lower(): int((labels == label).sum()) for label in Label}
    assert after["points"]["moving"] < before["points"]["moving"]
    n_moving = sum(verdict == "moving" for verdict, _ in again.tracks.values())
    assert after["tracks"] == {"total": len(again.tracks), "moving": n_moving}
    assert after["tracks"]["total"] == before["tracks"]["total"] - 1
    assert after["recording"] == before["recording"]


def test_merged_results_know_which_points_are_ground(run, root, tmp_path):
    merge(run, root / "sustech", tmp_path / "out")
    again = RunFiles(tmp_path / "out", run.sequence)
    before, after = (r.is_ground(r.scan(3), 3) for r in (run, again))
    assert before.any()
    np.testing.assert_array_equal(after, before)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"obj_type": "Car"}, r"has a box of class 'Car'; classes are unknown, static, moving"),
        ({"psr": {"position": {"x": 1}}}, r"is not a label file of SUSTechPOINTS"),
    ],
)
def test_boxes_that_cannot_be_used_are_told_with_their_file(run, root, tmp_path, change, message):
    scene = Scene("sustech", root, tmp_path)
    index = next(i for i, boxes in enumerate(scene.scans) if boxes)
    scene.scans[index][0].update(change)
    with pytest.raises(InputError, match=rf"{run.names[index]}.json {message}"):
        merge(run, scene.save(), tmp_path / "out")


def test_boxes_that_are_tilted_or_twice_or_of_no_size_are_told(run, root, tmp_path):
    for key, value, message in (
        ("rotation", {"x": 1.0, "y": 0.0, "z": 0.0}, "is tilted by"),
        ("scale", {"x": -0.1, "y": 1.0, "z": 1.0}, "has a box of size"),
    ):
        scene = Scene("sustech", root, tmp_path / key)
        next(boxes for boxes in scene.scans if boxes)[0]["psr"][key] = value
        with pytest.raises(InputError, match=message):
            merge(run, scene.save(), tmp_path / "out")
    scene = Scene("sustech", root, tmp_path / "twice")
    boxes = next(boxes for boxes in scene.scans if boxes)
    boxes.append(boxes[0])
    with pytest.raises(InputError, match="has two boxes with obj_id"):
        merge(run, scene.save(), tmp_path / "out")


def test_places_that_hold_no_corrections_are_told(run, tmp_path):
    with pytest.raises(InputError, match=r"nowhere does not exist"):
        merge(run, tmp_path / "nowhere", tmp_path / "out")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="is neither a SUSTechPOINTS scene"):
        merge(run, tmp_path / "empty", tmp_path / "out")
    (tmp_path / "broken.json").write_text("{")
    with pytest.raises(InputError, match=r"broken.json is damaged"):
        merge(run, tmp_path / "broken.json", tmp_path / "out")
    (tmp_path / "other" / "label").mkdir(parents=True)
    (tmp_path / "other" / "label" / "777777.json").write_text("[]")
    with pytest.raises(InputError, match="has corrections of a scan '777777', which lane has not"):
        merge(run, tmp_path / "other", tmp_path / "out")
    (tmp_path / "labels").mkdir()
    (tmp_path / "labels" / "777777.label").write_bytes(b"")
    with pytest.raises(InputError, match="has corrections of a scan '777777', which lane has not"):
        merge(run, tmp_path / "labels", tmp_path / "out")
    with pytest.raises(InputError, match="choose another --out"):
        merge(run, tmp_path / "empty", run.folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda boxes: boxes[0].update(type="cuboid"), "'cuboid' .* does not match any of the expected tags"),
        (lambda boxes: boxes[0].update(label_id=-1), "label_id: input should be greater than or equal to 0"),
        (lambda boxes: boxes[0].update(label_id=99), "has a box of class 99, but names 3"),
        (lambda boxes: boxes[0]["attributes"].update(outside="-"), "outside: input should be a valid boolean"),
        (lambda boxes: boxes[0]["attributes"].update(track_id=1.5), "track_id: input should be a valid integer"),
        (lambda boxes: boxes.append(boxes[0]), "has two boxes of track"),
    ],
)
def test_boxes_of_cvat_that_would_be_taken_for_others_are_told(run, root, tmp_path, change, message):
    scene = Scene("cvat", root, tmp_path)
    change(next(boxes for boxes in scene.scans if boxes))
    with pytest.raises(InputError, match=f"export.zip .*{message}"):
        merge(run, pack_as_cvat(scene), tmp_path / "out")


def test_an_archive_whose_packed_bytes_are_damaged_is_told(run, root, tmp_path):
    path = pack_as_cvat(Scene("cvat", root, tmp_path))
    with zipfile.ZipFile(path) as archive:
        document = archive.read("annotations/default.json")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("annotations/default.json", document)
    content = bytearray(path.read_bytes())
    content[30 + len("annotations/default.json")] = 0xFF  # no kind of block that deflate knows
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"export\.zip is damaged \(.*\); export it from CVAT again"):
        merge(run, path, tmp_path / "out")


def test_a_scan_that_cvat_has_twice_is_told_and_a_tag_of_a_scan_is_passed_over(run, root, tmp_path):
    scene = Scene("cvat", root, tmp_path)
    scene.scans[0].append({"type": "label", "label_id": 0})
    assert not merge(run, pack_as_cvat(scene), tmp_path / "out").points
    scene._document["items"].append(scene._document["items"][0])
    with pytest.raises(InputError, match="has the boxes of a scan twice"):
        merge(run, pack_as_cvat(scene), tmp_path / "out")


def test_results_that_are_being_replaced_are_no_results_until_the_last_file(run, root, tmp_path, monkeypatch):
    out = tmp_path / "merged"
    merge(run, run.folder / "predictions", out)
    assert (out / "run.json").exists()
    monkeypatch.setattr("automos.writers.merge.pack", lambda *labels: 1 / 0)  # killed before the first label
    with pytest.raises(ZeroDivisionError):
        merge(run, run.folder / "predictions", out)
    with pytest.raises(InputError, match="was not labelled to its end"):
        RunFiles(out, run.sequence)
    monkeypatch.undo()
    merge(run, run.folder / "predictions", out)  # goes on in what was left
    assert len(RunFiles(out, run.sequence)) == len(run)


def test_labels_of_another_program_are_not_replaced(run, tmp_path):
    (tmp_path / "theirs" / "predictions").mkdir(parents=True)
    (tmp_path / "theirs" / "predictions" / "000000.label").write_bytes(b"theirs")
    with pytest.raises(InputError, match="automos did not make that folder: choose another --out"):
        merge(run, run.folder / "predictions", tmp_path / "theirs")


def test_corrections_are_not_written_over_by_what_is_made_of_them(run, root, tmp_path):
    other = shutil.copytree(root / "run", tmp_path / "other")
    for corrected, out in ((other / "predictions", other), (root / "sustech", root / "sustech")):
        with pytest.raises(InputError, match="holds the corrections, which would be written over"):
            merge(run, corrected, out)
    assert (other / "run.json").read_bytes() == (root / "run" / "run.json").read_bytes()


def test_what_another_run_left_does_not_stay_among_the_results(run, root, tmp_path):
    out = tmp_path / "out"
    merge(run, root / "sustech", out)
    for stale in ("predictions/999999.label", f"confidences/{run.names[0]}.npy"):
        (out / stale).parent.mkdir(exist_ok=True)
        (out / stale).write_bytes(b"of another run")
    merge(run, root / "sustech", out)
    assert sorted(path.stem for path in (out / "predictions").iterdir()) == sorted(run.names)
    assert not any(out.glob("confidences/*"))


@pytest.mark.parametrize("fill", [np.nan, np.inf])
def test_points_that_are_not_finite_are_left_out_of_what_tools_show_and_unedited_nothing_changes(tmp_path, fill):
    recording = tmp_path / "lane"
    write_bins(lane().sequence, recording)
    for path in recording.rglob("*.bin"):
        rows = np.fromfile(path, np.float32).reshape(-1, 4)
        rows = np.insert(rows, np.arange(3, len(rows) + 1, 3), 0.0, axis=0)
        rows[3::4, :3] = fill, -fill, fill
        rows.tofile(path)
    done = CliRunner().invoke(app, ["label", str(recording), "--out", str(tmp_path / "run"), "--workers", "1"])
    assert done.exit_code == 0, done.output
    sequence = open_sequence(recording)
    run = RunFiles(tmp_path / "run", sequence)
    before = [run.labels(i, len(sequence[i])) for i in range(len(sequence))]
    n_boxes = sum(len(run.boxes_upright(i)) for i in range(len(sequence)))
    assert n_boxes
    for tool in (*TOOLS, "supervisely", "segments"):
        export_run(tmp_path / "run", [sequence], tool, tmp_path / tool)
        clouds = sorted((tmp_path / tool).rglob("*.pcd"))
        assert len(clouds) == len(sequence)
        for i, path in enumerate(clouds):
            columns = read_columns(path, "pcd")
            assert len(columns["x"]) == int(np.isfinite(sequence[i].points).all(axis=1).sum())
            assert all(np.isfinite(columns[axis]).all() for axis in "xyz")
    segmentation = json.loads((tmp_path / "segments" / "segmentation.json").read_text())
    assert [len(frame["point_annotations"]) for frame in segmentation["frames"]] == [
        int(np.isfinite(scan.points).all(axis=1).sum()) for scan in sequence
    ]
    for tool, corrected in (("cvat", "cvat/annotations.zip"), ("sustech", "sustech")):
        merged = merge(run, tmp_path / corrected, tmp_path / f"merged_{tool}")
        assert dict(merged.boxes) == {"unchanged": n_boxes}
        assert merged.scans == 0
        after = [
            np.fromfile(p, np.uint32) & 0xFFFF
            for p in sorted((tmp_path / f"merged_{tool}" / "predictions").glob("*.label"))
        ]
        assert all(map(np.array_equal, before, after))
