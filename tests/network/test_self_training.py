import numpy as np
import pytest
from worlds import iou_of_moving, lane

from automos import label, load_settings
from automos.core.errors import InputError
from automos.core.labels import Label
from automos.pipeline import stage_keys


@pytest.fixture(scope="module")
def world():
    return lane(12)


def with_cue(folder, weight: float):
    overrides = {"self_training.folder": str(folder), "self_training.weight": weight}
    return load_settings("default", overrides=overrides)


def labels_of(world, settings) -> list[np.ndarray]:
    result = label(world.sequence, settings, poses=world.poses, workers=1)
    return [result.labels(i) for i in range(len(world.sequence))]


def test_a_network_that_knows_helps_and_one_that_does_not_changes_nothing(world, tmp_path):
    knows, does_not = tmp_path / "knows", tmp_path / "does_not"
    for folder in (knows, does_not):
        folder.mkdir()
    for name, truth in zip(world.sequence.names, world.truth, strict=True):
        np.save(knows / f"{name}.npy", (truth == Label.MOVING).astype(np.float16))
        np.save(does_not / f"{name}.npy", np.full(len(truth), 0.5, np.float16))
    alone = labels_of(world, load_settings("default"))
    unsure = labels_of(world, with_cue(does_not, 1.0))
    assert all(np.array_equal(a, b) for a, b in zip(alone, unsure, strict=True))
    helped = labels_of(world, with_cue(knows, 2.0))
    assert iou_of_moving(helped, world.truth) >= iou_of_moving(alone, world.truth)


def test_another_cue_is_another_run_and_none_changes_no_key(world, tmp_path):
    plain = stage_keys(world.sequence, load_settings("default"))
    with_cue = load_settings("default", overrides={"self_training.folder": str(tmp_path)})
    keys = stage_keys(world.sequence, with_cue)
    assert keys["odometry"] == plain["odometry"]
    assert keys["candidates"] != plain["candidates"]
    np.save(tmp_path / "000000.npy", np.zeros(3))
    assert stage_keys(world.sequence, with_cue)["candidates"] != keys["candidates"]
    weighed = load_settings("default", overrides={"self_training.weight": 2.0})
    assert stage_keys(world.sequence, weighed) == plain


def test_a_cue_of_another_recording_is_told(world, tmp_path):
    with pytest.raises(InputError, match=r"000000\.npy cannot be read"):
        labels_of(world, with_cue(tmp_path, 1.0))
