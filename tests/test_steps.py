"""Stages made part by part give what they give at once."""

import numpy as np
import pytest
from worlds import street

from automos.core.workspace import Workspace
from automos.evidence.free_space import FreeSpace
from automos.pipeline import Steps, stage_keys
from automos.settings import load_settings


@pytest.fixture(scope="module")
def world():
    return street(16)


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_labels_made_in_parts_are_those_made_at_once(world, preset, tmp_path):
    settings = load_settings(preset)
    whole = Steps(world.sequence, settings, poses=world.poses, workers=1).found()
    for scans in (range(9, 16), range(0, 5), range(5, 9)):  # in any order, each as a process of its own would
        Steps(world.sequence, settings, world.poses, Workspace(tmp_path), workers=1).instances(scans)
    for scans in (range(0, 7), range(7, 16)):
        Steps(world.sequence, settings, world.poses, Workspace(tmp_path), workers=1).labels(scans)
    parts = Steps(world.sequence, settings, poses=world.poses, workspace=Workspace(tmp_path), workers=1).found()
    assert all(seconds == 0 for seconds in parts.seconds.values())  # nothing was left to do
    for i in range(16):
        np.testing.assert_array_equal(parts.labels(i), whole.labels(i))
        np.testing.assert_array_equal(parts.track_ids(i), whole.track_ids(i))
        np.testing.assert_array_equal(parts.confidence(i), whole.confidence(i))


def test_a_part_is_all_that_is_made(world, tmp_path):
    steps = Steps(world.sequence, load_settings("default"), world.poses, Workspace(tmp_path), workers=1)
    found = steps.instances(range(4, 7))
    assert [i for i, name in enumerate(steps.run.names) if found.has(name)] == [4, 5, 6]


def test_evidence_reads_no_further_than_its_part_may_ask(world, monkeypatch):
    # a part of a two-hour recording must not cost what the recording costs
    settings = load_settings("default")
    steps = Steps(world.sequence, settings, world.poses, workers=1)
    about = settings.candidates
    space = FreeSpace(steps.frames, steps.trajectory.stamps, about, 1)
    asked = []
    partners = space.partners
    monkeypatch.setattr(space, "partners", lambda i: asked.append(i) or partners(i))
    assert [i for i, _, _ in space.collect(3, 6)] == [3, 4, 5]
    assert asked == [3, 4, 5]


def test_what_shapes_results_changes_the_fingerprints(world):
    settings = load_settings("default")
    assert stage_keys(world.sequence, settings) == stage_keys(world.sequence, load_settings("default"))
    other = load_settings("default", None, {"odometry.max_range": 50.0})
    assert stage_keys(world.sequence, settings) != stage_keys(world.sequence, other)
