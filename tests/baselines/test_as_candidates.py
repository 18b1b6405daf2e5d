"""Baselines as the pipeline's candidates."""

import pytest
from worlds import iou_of_moving, lane

from automos import InputError, label
from automos.baselines import methods, yoon
from automos.evidence import published
from automos.pipeline import stage_keys
from automos.settings import load_settings


@pytest.mark.parametrize("method", ["yoon", "m_detector"])
def test_the_pipeline_finds_movers_from_another_methods_candidates(method):
    world = lane(24)  # scans of two seconds say much the same: a verdict takes longer with what a rival sees
    settings = load_settings("default", None, {"candidates.method": method})
    result = label(world.sequence, settings, poses=world.poses, workers=1)
    assert iou_of_moving([result.labels(i) for i in range(24)], world.truth) > 0.3


def test_parameters_of_a_rival_matter_to_a_run_that_uses_it_and_to_no_other(monkeypatch):
    def keys(**values):
        return stage_keys(lane(2).sequence, load_settings("default", None, values))

    used = {"candidates.method": "yoon"}
    plain, with_yoon = keys(), keys(**used)
    monkeypatch.setattr(methods, "published", lambda name: yoon.Parameters(margin=0.7))
    assert keys() == plain
    assert keys(**used)["odometry"] == with_yoon["odometry"]
    assert keys(**used)["candidates"] != with_yoon["candidates"]


def test_a_method_that_nobody_hands_in_is_named(monkeypatch):
    monkeypatch.setattr(published, "entry_points", lambda group: [])
    with pytest.raises(InputError, match="hands in the method yoon"):
        label(lane(2).sequence, load_settings("default", None, {"candidates.method": "yoon"}), workers=1)
