"""What docs/conventions.md says of a run's folder is what a run writes."""

import re
from pathlib import Path

import numpy as np
import pytest
from worlds import lane

import automos
from automos import load_settings
from automos.labeling import label_recording

PAGE = (Path(__file__).parents[1] / "docs" / "conventions.md").read_text()
ARRAY = re.compile(r"(\w+) \(([A-Z0-9, ]+)\) (float16|float64|u?int(?:8|32|64))")
STAGES = {
    stage: ARRAY.findall(text)
    for stage, text in re.findall(r"^    (\w+)-KEY/\S+(.*?)(?=^    \w+-KEY|^```)", PAGE, re.DOTALL | re.MULTILINE)
}
N_SCANS = 14


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "lane"
    label_recording(lane(N_SCANS).sequence, folder, load_settings("default"), workers=1)
    return folder


def test_the_page_has_every_stage(run):
    assert set(STAGES) == {path.name.rpartition("-")[0] for path in (run / "stages").iterdir()}
    assert all(STAGES.values())


@pytest.mark.parametrize("stage", STAGES)
def test_an_array_of_a_stage_has_the_shape_and_dtype_on_the_page(run, stage):
    (folder,) = (run / "stages").glob(f"{stage}-*")
    sizes = {"S": N_SCANS, "N": len(lane(N_SCANS).sequence[0])}
    with np.load(min(folder.glob("*.npz"))) as arrays:  # all.npz, or that of the first scan
        for name, dims, dtype in STAGES[stage]:
            assert arrays[name].dtype == dtype, name
            wanted = [int(dim) if dim.isdigit() else dim for dim in dims.split(", ")]
            assert arrays[name].ndim == len(wanted), name
            for dim, size in zip(wanted, arrays[name].shape, strict=True):
                assert size == (dim if isinstance(dim, int) else sizes.setdefault(dim, size)), name


def test_what_is_beside_the_stages_is_on_the_page(run):
    tree = PAGE.partition("automos_runs/NAME/")[2].partition("```")[0]
    assert all(path.name in tree for path in run.iterdir())


def test_a_point_of_a_scan_is_mapped_into_the_world_and_the_level_frame_as_the_page_says():
    world = lane(N_SCANS)
    result = automos.label(world.sequence, workers=1)
    T_world_sensor, T_level_world = result.trajectory.T_world_sensor, result.trajectory.T_level_world
    assert np.allclose(T_world_sensor[0], np.eye(4), atol=1e-9)
    wall = np.array([3.0, -2.0, 0.5, 1.0])
    seen_later = np.linalg.inv(world.poses[-1]) @ world.poses[0] @ wall  # the same place, in the last scan's frame
    assert np.linalg.norm((T_world_sensor[-1] @ seen_later - wall)[:3]) < 0.1
    normal = T_level_world[2, :3]  # z of the level frame, in the world
    assert normal @ [0.0, 0.0, 1.0] > 0.99
