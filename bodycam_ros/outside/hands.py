"""A body with hands: no camera is strapped to them, so no range of motion finds them, but static cameras see them."""

from dataclasses import replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anatomy import SegmentName
from bodycam_ros.geometry import Array, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.outside import girths

_WRIST_LIMITS = ((-1.3, 1.3), (-0.3, 0.3), (-0.7, 0.7))
"""[rad] of its angles in the order y, z, x: to the sides, about the forearm, and towards the palm."""


def with_hands(body: BodyModel) -> BodyModel:
    """The body with a hand on each forearm that has none, at a wrist as far from the elbow as the upper arm is long."""
    segments, joints = list(body.segments), list(body.joints)
    for segment in body.segments:
        name = SegmentName(segment)
        hand = f"hand{name.side}"
        if name.kind == "forearm" and hand not in segments:
            segments.append(hand)
            joints.append(_wrist(body, segment, hand, f"wrist{name.side}"))
    return replace(body, segments=tuple(segments), joints=tuple(joints))


def _wrist(body: BodyModel, forearm: str, hand: str, name: str) -> Joint:
    place = rigid(np.eye(3), -_forearm_length(body, forearm) * np.array([0.0, 0.0, 1.0]))
    return Joint(name, forearm, hand, "ball", place, angle_axes="yzx", limits=_WRIST_LIMITS)


def _forearm_length(body: BodyModel, forearm: str) -> float:
    """From elbow to wrist [m], by the length of the upper arm; by the body's stature where there is none."""
    elbow = body.joint_to_parent(forearm)
    upper_arm: Array = np.zeros(3) if elbow is None else elbow.parent_T_joint[:3, 3]
    length = float(np.linalg.norm(upper_arm))
    if elbow is None or SegmentName(elbow.parent).kind != "upper_arm" or length < 0.05:
        return girths.BONES["forearm"] * girths.stature_of(body)
    return length * girths.BONES["forearm"] / girths.BONES["upper_arm"]
