"""Joint limits from the range that was exercised, and hinges where joints turned as such."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.rest_pose import ZeroedMotion
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngleTracker
from bodycam_ros.settings import setting

_PERCENTILE = 0.5  # [%] of the states beyond each limit: one wrong state must not open a joint


@dataclass(frozen=True)
class JointLimitSettings:
    """Limits of joints, in URDF and for the solver."""

    hold_hinges: bool = setting(
        False,
        reason="true makes hinges of the joints that turned as such, and the solver holds them to their axis; people's "
        "elbows and knees turn about others too, and every segment carries a camera that sees it",
    )
    margin: float = setting(
        0.09,
        unit="rad",
        limits=(0.0, 3.2),
        reason="added to the range that was exercised: people go a little further another day",
    )


def limited_body(zeroed: ZeroedMotion, settings: JointLimitSettings) -> BodyModel:
    """The body of a motion, its joints limited to what they did and the N-pose."""
    body = _with_hinges(zeroed.motion.body, zeroed.hinges) if settings.hold_hinges else zeroed.motion.body
    tracker = JointAngleTracker(body)
    angles = np.stack([tracker.angles(poses) for poses in zeroed.motion.world_T_segment()])
    low, high = np.percentile(angles, [_PERCENTILE, 100.0 - _PERCENTILE], axis=0)
    low, high = np.minimum(low, 0.0) - settings.margin, np.maximum(high, 0.0) + settings.margin
    limit_of = {name: (float(low[column]), float(high[column])) for column, name in enumerate(tracker.names)}
    joints = tuple(replace(joint, limits=tuple(limit_of[name] for name in joint.angle_names)) for joint in body.joints)
    return replace(body, joints=joints)


def _with_hinges(body: BodyModel, axes: Mapping[str, Array]) -> BodyModel:
    """The body with a hinge (3,) above each of some segments."""
    joints = tuple(
        replace(joint, type="hinge", axis=axes[joint.child], sigmas=None) if joint.child in axes else joint
        for joint in body.joints
    )
    return replace(body, joints=joints)
