"""The sentence says whether labels can be trusted, and why."""

import pytest

from automos.views.caveats import trust_in

FINE = {"odometry": {"warnings": [], "wall_thickness_m": 0.028}}


def test_without_a_warning_labels_can_be_trusted_and_it_says_how_sure_they_are():
    found = trust_in(FINE, [], 0.987)
    assert found["level"] == "yes"
    assert found["sentence"] == (
        "These labels can be trusted: no warning, and the path agrees with itself (walls seen again and again are 3 cm "
        "thick); by the confidence of its objects, 98.7 % of what is labelled moving does move."
    )


def test_places_to_look_at_are_said_beside_what_is_fine():
    place = {"sentence": "Object 3 ends early.", "scan": "000007"}
    found = trust_in(FINE | {"warnings": [place]}, [], 0.9)
    assert found["level"] == "yes"
    assert "no warning but of 1 place below, and the path agrees" in found["sentence"]
    assert "of 2 places below" in trust_in(FINE | {"warnings": [place, place]}, [], 0.9)["sentence"]


@pytest.mark.parametrize(
    "odometry", [{"warnings": ["it slipped"]}, {"warnings": [], "is_speed_doubted": True}], ids=["warned", "doubted"]
)
def test_where_the_path_is_in_doubt_nothing_else_counts(odometry):
    found = trust_in({"odometry": odometry}, ["it slipped"], 1.0, {"iou": 0.99})
    assert found["level"] == "no"
    assert "cannot be trusted" in found["sentence"]
    assert "path is in doubt" in found["sentence"]


def test_other_warnings_are_to_be_looked_at_first():
    assert "2 things below" in trust_in(FINE, ["a", "b"], 0.9)["sentence"]
    found = trust_in({}, ["a"], None)
    assert (found["level"], "nothing was found to move" in found["sentence"]) == ("look", True)


def test_a_sample_says_more_than_confidence_and_truth_more_than_a_sample():
    sampled = FINE | {"quality": {"precision": {"value": 0.95, "low": 0.88, "high": 0.99}}}
    assert "by a random sample, 88 to 99 %" in trust_in(sampled, [], 0.987)["sentence"]
    assert "the IoU of what moves is 96.5 %" in trust_in(sampled, [], 0.987, {"iou": 0.965})["sentence"]
    assert "by a random sample" in trust_in(sampled, [], 0.987, {"iou": None})["sentence"]  # nothing moves in truth
