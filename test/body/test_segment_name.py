"""Names of segments taken apart, and put together again."""

import pytest

from bodycam_ros.body.average_person import body_of_height
from bodycam_ros.body.segment_name import SegmentName, mirrored


@pytest.mark.parametrize(
    ("segment", "kind", "side", "joint", "words"),
    [
        ("shin_left", "shin", "_left", "knee_left", "left shin"),
        ("upper_arm_right", "upper_arm", "_right", "shoulder_right", "right upper arm"),
        ("head", "head", "", "neck", "head"),
        ("pelvis", "pelvis", "", "pelvis_joint", "pelvis"),
        ("tail_left", "tail", "_left", "tail_left_joint", "left tail"),
        ("left", "left", "", "left_joint", "left"),
    ],
)
def test_parts_of_a_name(segment: str, kind: str, side: str, joint: str, words: str) -> None:
    name = SegmentName(segment)
    assert (name.kind, name.side, name.joint, name.words) == (kind, side, joint, words)


def test_a_mirrored_name_mirrored_is_the_name() -> None:
    body = body_of_height(1.8, "person")
    for segment in body.segments:
        other = mirrored(segment)
        assert other is None or (other in body.segments and other != segment and mirrored(other) == segment)
    assert [segment for segment in body.segments if mirrored(segment) is None] == ["pelvis", "torso", "head"]


def test_joints_of_the_default_body_are_those_that_the_names_have() -> None:
    body = body_of_height(1.8, "person")
    for joint in body.tree_joints:
        assert joint.name == SegmentName(joint.child).joint
        assert joint.angle_axes == SegmentName(joint.child).angle_axes or joint.name.startswith("wrist")


def test_an_exercise_names_the_limb_and_its_side() -> None:
    for segment in ("upper_arm_left", "foot_right", "tail"):
        assert SegmentName(segment).words in SegmentName(segment).exercise
    assert SegmentName("shin_left").straight_in_rest and not SegmentName("thigh_left").straight_in_rest
