"""Maps: one point per voxel, what moves left out, memory of what is near, figures computed by hand."""

import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner
from worlds import SENSOR_HEIGHT, lane, write_bins

from automos.cli import app
from automos.core.errors import InputError
from automos.core.scan import Frame
from automos.readers import open_sequence
from automos.settings import MapSettings
from automos.writers.maps.make_map import make_map
from automos.writers.maps.metrics import MapCounts, Tiles
from automos.writers.maps.writers import HeightPicture, open_cloud


def level_frames(world):
    """Return the frames of a tiny world; its level frame is the ground under the first scan."""

    class Frames:
        T_level_sensor = world.poses + np.array([[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, SENSOR_HEIGHT], [0, 0, 0, 0]])

        def __len__(self):
            return len(world.sequence)

        def __getitem__(self, i):
            scan = world.sequence[i]
            return Frame(scan.points, np.arange(len(scan)), len(scan), self.T_level_sensor[i], 0.1 * i)

    return Frames()


# ---------------------------------------------------------------------------------------------------------- tiles
def test_a_voxel_becomes_the_mean_of_its_points_and_tiles_do_not_cut_voxels():
    rng = np.random.default_rng(0)
    points = rng.uniform(-30.0, 30.0, (5000, 3)).astype(np.float32)
    tiles = Tiles(voxel=2.0, side=9.0)
    tiles.add(points[:2500])
    tiles.add(points[2500:])
    got = np.concatenate([tile.voxels.mean for tile in tiles.rest()])
    voxels, rows = np.unique(np.floor(points.astype(np.float64) / 2.0), axis=0, return_inverse=True)
    want = np.stack([np.bincount(rows.ravel(), points[:, k]) / np.bincount(rows.ravel()) for k in range(3)], axis=1)
    assert len(got) == len(voxels)
    assert np.allclose(got[np.lexsort(got.T)], want[np.lexsort(want.T)], atol=1e-3)


def test_tiles_behind_the_sensor_are_given_away_and_the_number_kept_stays_small():
    tiles, most, points_seen = Tiles(voxel=1.0, side=20.0), 0, 0
    for x in range(0, 1000, 5):
        tiles.add(np.array([[x + 0.5, 0.5, 0.5]]))
        points_seen += sum(len(tile.voxels) for tile in tiles.leave(np.array([x, 0.0]), 50.0))
        most = max(most, len(tiles))
    assert most <= 5
    assert points_seen + sum(len(tile.voxels) for tile in tiles.rest()) == 200


# -------------------------------------------------------------------------------------------------------- writers
@pytest.mark.parametrize("kind", ["ply", "pcd", "laz"])
def test_what_is_written_in_pieces_is_read_back_as_one(kind, tmp_path):
    if kind == "laz":
        pytest.importorskip("lazrs")
    points = np.random.default_rng(0).uniform(-900.0, 900.0, (1000, 3)).astype(np.float32)
    with open_cloud(tmp_path / f"map.{kind}") as write:
        for piece in np.split(points, [10, 10, 700]):
            write(piece)
    got = open_sequence(tmp_path)[0].points
    assert np.allclose(got, points, atol=1e-4)


def test_an_unknown_kind_is_refused_and_a_failure_leaves_no_file(tmp_path):
    with (
        pytest.raises(InputError, match=r"map\.xyz is of no kind.*\.ply, \.pcd or \.laz"),
        open_cloud(tmp_path / "map.xyz"),
    ):
        pass
    with pytest.raises(ValueError, match="could not convert"), open_cloud(tmp_path / "map.ply") as write:
        write(np.array(["no", "points"]))
    assert list(tmp_path.iterdir()) == []


# -------------------------------------------------------------------------------------------------------- metrics
def test_a_map_further_than_laz_reaches_is_told_and_leaves_no_file(tmp_path):
    pytest.importorskip("lazrs")
    with pytest.raises(InputError, match="further than 215 km"), open_cloud(tmp_path / "map.laz") as write:
        write(np.array([[3e5, 0.0, 0.0]], np.float32))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["ply", "pcd", "laz"])
def test_a_map_that_a_full_disk_does_not_take_is_told_and_leaves_no_file(kind, tmp_path):
    resource = pytest.importorskip("resource")
    if kind == "laz":
        pytest.importorskip("lazrs")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))  # no file may have more bytes
    try:
        told = pytest.raises(InputError, match=rf"map\.{kind} could not be written")
        with told, open_cloud(tmp_path / f"map.{kind}") as write:
            write(np.random.default_rng(0).uniform(-50.0, 50.0, (10_000, 3)).astype(np.float32))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


def test_map_figures_are_those_computed_by_hand():
    # x decides the voxel (0.2 m): two static voxels, a mixed one, two of a mover
    x = np.array([0.1, 0.1, 1.1, 2.1, 2.1, 3.1, 3.1, 4.1])
    is_static = np.array([1, 1, 1, 1, 0, 0, 0, 0], bool)
    is_kept = np.array([1, 0, 0, 1, 1, 1, 0, 0], bool)
    counts = MapCounts()
    counts.add(np.column_stack([x, x * 0 + 0.1, x * 0 + 0.1]), is_static, ~is_static, is_kept)
    scores = counts.scores()
    assert scores.preservation == pytest.approx(2 / 3)  # voxels 0 and 2 of 0, 1, 2
    assert scores.rejection == pytest.approx(1 / 2)  # voxel 4 of 3 and 4; the mixed one is static
    assert scores.f1 == pytest.approx(2 * (2 / 3) * (1 / 2) / (2 / 3 + 1 / 2))
    assert scores.static_accuracy == pytest.approx(2 / 4)
    assert scores.dynamic_accuracy == pytest.approx(2 / 4)
    assert scores.associated_accuracy == pytest.approx(1 / 2)


def test_map_figures_without_anything_that_moves_have_no_rejection():
    counts = MapCounts()
    counts.add(np.zeros((1, 3)), np.array([True]), np.array([False]), np.array([True]))
    scores = counts.scores()
    assert scores.preservation == 1.0
    assert np.isnan([scores.rejection, scores.f1, scores.dynamic_accuracy]).all()


# ----------------------------------------------------------------------------------------------------------- maps
def test_the_highest_point_of_a_pixel_is_seen():
    picture = HeightPicture(np.zeros(2), np.array([10.0, 10.0]), max_pixels=10)
    picture.add(np.array([[0.5, 0.5, 1.0], [0.6, 0.6, 3.0], [0.7, 0.7, 2.0], [99.0, 0.0, 9.0]]))
    assert picture.heights[0, 0] == 3.0
    assert np.isfinite(picture.heights).sum() == 1


def test_the_map_holds_what_stands_and_not_what_moves(tmp_path):
    world = lane()
    made = make_map(
        level_frames(world), world.sequence, lambda i, n: world.truth[i], tmp_path, ["ply"], MapSettings(voxel=0.2)
    )
    points = open_sequence(tmp_path / "map.ply" if (tmp_path / "map.ply").is_dir() else tmp_path)[0].points
    assert len(points) == made.n_points
    is_high = points[:, 2] > 0.4
    assert is_high.any()
    assert (np.abs(points[is_high, 1]) > 10.5).all()  # the walls; both cyclists rode between them
    assert (tmp_path / "map_raw.png").read_bytes() != (tmp_path / "map_clean.png").read_bytes()
    assert made.scores is None
    assert json.loads((tmp_path / "map.json").read_text())["points"] == made.n_points


def test_the_command_writes_the_map_and_its_pictures(tmp_path):
    write_bins(lane().sequence, tmp_path / "lane")
    words = ["map", tmp_path / "lane", "--method", "yoon", "--kind", "pcd", "--voxel", "0.3", "--out", tmp_path / "out"]
    words += ["--kind", "pcd"]  # once more is no other map
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == 0, done.output
    assert {"map.pcd", "map_raw.png", "map_clean.png", "map.json"} <= {p.name for p in (tmp_path / "out").iterdir()}
    assert json.loads((tmp_path / "out" / "map.json").read_text())["voxel"] == 0.3


def test_a_map_of_results_has_their_labels_as_corrected(lane_run, tmp_path):
    run = shutil.copytree(lane_run, tmp_path / "run")
    words = ["map", str(run), "--out", str(tmp_path / "map")]
    assert CliRunner().invoke(app, words).exit_code == 0
    before = json.loads((tmp_path / "map" / "map.json").read_text())["points"]
    for path in sorted((run / "predictions").iterdir())[:6]:  # as a review that found a wall moving would leave them
        labels = np.fromfile(path, np.uint32)
        labels[: len(labels) // 2] = 251
        labels.tofile(path)
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.exception
    assert 0 < json.loads((tmp_path / "map" / "map.json").read_text())["points"] < before
    told = CliRunner().invoke(app, [*words, "--method", "removert"])
    assert "leave --method, --poses and --calib out" in str(told.exception)


def test_a_map_of_results_is_made_of_a_recording_that_is_elsewhere_now(lane_run, tmp_path):
    run, log = shutil.copytree(lane_run, tmp_path / "run"), shutil.copytree(lane_run.parent / "lane", tmp_path / "lane")
    about = json.loads((run / "run.json").read_text())
    about["recording"]["source"] = str(tmp_path / "gone")
    (run / "run.json").write_text(json.dumps(about))
    words = ["--out", str(tmp_path / "map")]
    assert "give its path, too" in str(CliRunner().invoke(app, ["map", str(run), *words]).exception)
    assert CliRunner().invoke(app, ["map", str(run), str(log), *words]).exit_code == 0
    assert "is no results folder" in str(CliRunner().invoke(app, ["map", str(log), str(run), *words]).exception)


@pytest.mark.parametrize("words", ["map RUN", "export RUN --to panoptic", "export RUN --to pcd", "evaluate RUN LOG"])
def test_all_that_is_made_of_a_run_follows_its_label_files(lane_run, tmp_path, words):
    made = []
    for change in (False, True):
        run = shutil.copytree(lane_run, tmp_path / f"run{change}")
        for path in (run / "predictions").iterdir() if change else ():
            labels = np.fromfile(path, np.uint32)
            labels[:] = 9
            labels.tofile(path)
        given = {"RUN": run, "LOG": lane_run.parent / "lane"}
        option = "--json" if words.startswith("evaluate") else "--out"
        out = tmp_path / f"out{change}"
        done = CliRunner().invoke(app, [str(given.get(word, word)) for word in [*words.split(), option, out]])
        assert done.exit_code == 0, done.exception
        files = [out] if out.is_file() else sorted(path for path in out.rglob("*") if path.is_file())
        made.append([path.read_bytes() for path in files])
    assert made[0] != made[1]
