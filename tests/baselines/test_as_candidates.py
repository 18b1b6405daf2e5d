"""Baselines as the pipeline's candidates."""

import pytest
from worlds import iou_of_moving, lane

from automos import label
from automos.pipeline import stage_keys
from automos.settings import load_settings


@pytest.mark.parametrize("method", ["yoon", "m_detector"])
def test_the_pipeline_finds_movers_from_another_methods_candidates(method):
    world = lane(14)
    settings = load_settings("default", None, {"candidates.method": method})
    result = label(world.sequence, settings, poses=world.poses, workers=1)
    assert iou_of_moving([result.labels(i) for i in range(14)], world.truth) > 0.3


def test_settings_of_baselines_matter_to_a_run_that_uses_them_and_to_no_other():
    def keys(**values):
        return stage_keys(lane(2).sequence, load_settings("default", None, values))

    change = {"baselines.yoon.margin": 0.7}
    assert keys() == keys(**change)
    used = {"candidates.method": "yoon"}
    assert keys(**used)["odometry"] == keys(**used, **change)["odometry"]
    assert keys(**used)["candidates"] != keys(**used, **change)["candidates"]
