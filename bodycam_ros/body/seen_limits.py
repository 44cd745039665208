"""Limits of joint angles that give way to what was seen."""

from dataclasses import replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.limits import JointLimits

_MARGIN = 0.02  # [rad] widened by a little more than was seen, so that it need not be again at the next instant


class SeenLimits:
    """The body with limits that hold: widened by every joint angle that was seen beyond them.

    A range of motion is what a person did on one day; the next day they reach farther. Joints without limits, free ones
    among them, have none to keep.

    Attributes:
        body: with its limits as wide as they have been seen.
    """

    def __init__(self, body: BodyModel) -> None:
        self.body = body
        limits = JointLimits(body)
        self._low, self._high = limits.low, limits.high

    def widen(self, positions: Array) -> bool:
        """Whether joint angles (A) [rad] made limits give way."""
        below, above = positions < self._low, positions > self._high
        if not (below.any() or above.any()):
            return False
        self._low = np.where(below, positions - _MARGIN, self._low)
        self._high = np.where(above, positions + _MARGIN, self._high)
        pairs = iter(zip(self._low.tolist(), self._high.tolist(), strict=True))
        widened = {}
        for joint in self.body.tree_joints:
            of_joint = tuple(next(pairs) for _ in joint.angle_names)
            widened[joint.name] = replace(joint, limits=of_joint) if joint.limits else joint
        self.body = replace(self.body, joints=tuple(widened.get(joint.name, joint) for joint in self.body.joints))
        return True
