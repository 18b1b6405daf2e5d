import pickle

import numpy as np
import pytest
from bags import cloud, write_bag

from automos.core.errors import InputError
from automos.readers import open_sequence

FRAMES = {"/front/points": "front", "/rear/points": "rear"}
JOINTS = [
    ("base", "front", [1.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]),
    ("base", "rear", [-2.0, 0.0, 0.5], [0.0, 0.0, 1.0, 0.0]),  # looks backwards
]
BOTH = "front/points+rear/points"


def messages(stamps, x):
    columns = {
        "x": np.array([x, x], "f4"),
        "y": np.zeros(2, "f4"),
        "z": np.zeros(2, "f4"),
        "t": np.array([0, 50_000_000], "u4"),
    }
    return [(int(1e9 * stamp), stamp, cloud(columns)) for stamp in stamps]


def write(path, joints=JOINTS, rear=(0.03, 0.13, 0.33)):
    topics = {"/front/points": messages([0.0, 0.1, 0.2, 0.3], 5.0), "/rear/points": messages(rear, 7.0)}
    return write_bag(path, topics, frames=FRAMES, joints=joints)


def test_topics_are_merged_where_tf_static_says_that_their_lidars_sit(tmp_path):
    sequence = pickle.loads(pickle.dumps(open_sequence(write(tmp_path / "log.mcap") / BOTH)))
    assert len(sequence) == 4
    np.testing.assert_allclose(sequence.stamps, [0.0, 0.1, 0.2, 0.3])
    scan = sequence[1]
    np.testing.assert_array_equal(scan.sensor, [0, 0, 1, 1])
    np.testing.assert_allclose(scan.points[:, 0], [5.0, 5.0, -10.0, -10.0], atol=1e-5)
    np.testing.assert_allclose(
        scan.T_scan_sensor[1], [[-1, 0, 0, -3], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], atol=1e-9
    )
    np.testing.assert_allclose(scan.time, [0.0, 0.05, 0.03, 0.08], atol=1e-6)
    assert open_sequence(sequence.address).fingerprint() == sequence.fingerprint()


def test_a_scan_without_a_message_of_the_other_has_the_points_of_one(tmp_path):
    scan = open_sequence(write(tmp_path / "log.mcap") / BOTH)[2]
    np.testing.assert_array_equal(scan.sensor, [0, 0])
    assert len(scan.T_scan_sensor) == 2


@pytest.mark.parametrize(
    ("joints", "why"),
    [
        (JOINTS[:1], "/tf_static does not say where rear"),
        (
            [JOINTS[0], ("base", "rear", [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0])],
            "tf_static/rear holds a pose that is none",
        ),
    ],
)
def test_lidars_that_sit_nowhere_are_told(tmp_path, joints, why):
    with pytest.raises(InputError, match=why):
        open_sequence(write(tmp_path / "log.mcap", joints) / BOTH)


@pytest.mark.parametrize("topics", ["front/points+front/points", "front/points+rear/points+front/points/"])
def test_a_topic_that_is_named_twice_is_told(tmp_path, topics):
    with pytest.raises(InputError, match="names the topic /front/points twice"):
        open_sequence(f"{write(tmp_path / 'log.mcap')}/{topics}")


def test_scans_are_repeats_only_where_every_topic_gives_the_same_points(tmp_path):
    stamps = [0.0, 0.1, 0.2]
    front = messages(stamps, 5.0)  # stands still
    rear = [messages([t], x)[0] for t, x in zip(stamps, [7.0, 7.0, 8.0], strict=True)]
    topics = {"/front/points": front, "/rear/points": rear}
    sequence = open_sequence(write_bag(tmp_path / "log.mcap", topics, frames=FRAMES, joints=JOINTS) / BOTH)
    assert sequence.repeats.tolist() == [False, True, False]


def test_a_mount_that_was_sent_again_is_the_last_that_was_sent(tmp_path):
    wrong = ("base", "rear", [9.0, 9.0, 9.0], [0.0, 0.0, 0.0, 1.0])
    scan = open_sequence(write(tmp_path / "log.mcap", joints=[wrong, *JOINTS]) / BOTH)[1]
    np.testing.assert_allclose(scan.T_scan_sensor[1][:3, 3], [-3.0, 0.0, 0.0], atol=1e-9)


def test_a_transform_that_is_none_matters_only_between_the_lidars(tmp_path):
    unset = ("base", "gps", [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0])
    for joints in ([unset, *JOINTS], [*JOINTS, unset]):
        scan = open_sequence(write(tmp_path / "log.mcap", joints=joints) / BOTH)[1]
        np.testing.assert_allclose(scan.T_scan_sensor[1][:3, 3], [-3.0, 0.0, 0.0], atol=1e-9)
