"""Hands on a body that carries no camera on them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint_angles import angle_limits
from bodycam_ros.outside import girths
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.hands import with_hands


@pytest.fixture(scope="module")
def body(sample: Path) -> BodyModel:
    return read_body(sample / "body.yaml")


def without(body: BodyModel, *segments: str) -> BodyModel:
    return replace(
        body,
        segments=tuple(segment for segment in body.segments if segment not in segments),
        joints=tuple(joint for joint in body.joints if joint.child not in segments),
        mounts={name: mount for name, mount in body.mounts.items() if mount.segment not in segments},
    )


def test_each_forearm_gets_a_hand_at_its_end(body: BodyModel) -> None:
    handed = with_hands(body)
    assert handed.segments == (*body.segments, "hand_left", "hand_right")
    assert handed.joints[: len(body.joints)] == body.joints and handed.mounts == body.mounts
    for side in ("left", "right"):
        wrist, elbow = handed.joint_to_parent(f"hand_{side}"), handed.joint_to_parent(f"forearm_{side}")
        assert wrist is not None and elbow is not None
        assert wrist.name == f"wrist_{side}" and wrist.parent == f"forearm_{side}" and wrist.type == "ball"
        x, y, z = wrist.parent_T_joint[:3, 3]
        # A forearm is a little shorter than an upper arm, whose length the body knows.
        assert x == y == 0.0 and 0.7 < -z / np.linalg.norm(elbow.parent_T_joint[:3, 3]) < 1.0
    low, high = angle_limits(handed)
    assert (low[-6:] < 0.0).all() and (high[-6:] > 0.0).all() and (high[-6:] - low[-6:] < np.pi).all()


def test_hands_hang_down_in_the_n_pose_and_have_a_surface(body: BodyModel) -> None:
    handed = with_hands(body)
    poses = handed.forward_kinematics(np.eye(4), np.tile(np.eye(3), (len(handed.tree_joints), 1, 1)))
    hand, forearm = (poses[handed.segment_index[name], :3, 3] for name in ("hand_left", "forearm_left"))
    assert hand[2] < forearm[2] - 0.2 and np.abs(hand - forearm)[:2].max() < 1e-9
    surfaces = capsule_surfaces(handed)
    assert surfaces["hand_left"].vertices[:, 2].min() < -0.05
    assert set(surfaces) == set(handed.segments)


def test_who_has_hands_keeps_them(body: BodyModel) -> None:
    handed = with_hands(body)
    assert with_hands(handed).segments == handed.segments and with_hands(handed).joints == handed.joints
    one = without(handed, "hand_right")
    again = with_hands(one)
    assert again.segments == handed.segments
    assert again.joint_to_parent("hand_left") is one.joint_to_parent("hand_left")


def test_an_arm_of_unknown_length_is_as_long_as_people_of_that_size_have_them(body: BodyModel) -> None:
    """A forearm that hangs on the torso: nobody wore a camera on the upper arm, so the elbow is not known."""
    elbow = body.joint_to_parent("forearm_left")
    assert elbow is not None
    others = tuple(joint for joint in body.joints if joint.child != "forearm_left")
    odd = without(replace(body, joints=(*others, replace(elbow, parent="torso"))), "upper_arm_left")
    wrist = with_hands(odd).joint_to_parent("hand_left")
    assert wrist is not None
    assert -wrist.parent_T_joint[2, 3] == pytest.approx(girths.BONES["forearm"] * girths.stature_of(odd))
    assert 0.2 < -wrist.parent_T_joint[2, 3] < 0.3


def test_a_body_without_arms_has_no_hands(body: BodyModel) -> None:
    arms = [segment for segment in body.segments if "arm" in segment]
    armless = without(body, *arms)
    assert with_hands(armless).segments == armless.segments and with_hands(armless).joints == armless.joints
