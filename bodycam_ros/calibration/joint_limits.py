"""Joint limits from the range that was exercised."""

from dataclasses import dataclass, replace

import numpy as np

from bodycam_ros.body.articulation import ArticulatedMotion
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.kinematics.joint_angles import JointAngleTracker
from bodycam_ros.settings import setting

_PERCENTILE = 0.5  # [%] of the states beyond each limit: one wrong state must not open a joint


@dataclass(frozen=True)
class JointLimitSettings:
    """Limits of joints, in URDF and for the solver."""

    margin: float = setting(
        0.09,
        unit="rad",
        limits=(0.0, 3.2),
        reason="added to the range that was exercised: people go a little further another day",
    )


def limited_body(motion: ArticulatedMotion, settings: JointLimitSettings) -> BodyModel:
    """The body of a motion, its joints limited to what they did and the N-pose."""
    tracker = JointAngleTracker(motion.body)
    angles = np.stack([tracker.angles(poses) for poses in motion.world_T_segment()])
    low, high = np.percentile(angles, [_PERCENTILE, 100.0 - _PERCENTILE], axis=0)
    low, high = np.minimum(low, 0.0) - settings.margin, np.maximum(high, 0.0) + settings.margin
    limit_of = {name: (float(low[column]), float(high[column])) for column, name in enumerate(tracker.names)}
    joints = tuple(
        replace(joint, limits=tuple(limit_of[name] for name in joint.angle_names)) for joint in motion.body.joints
    )
    return replace(motion.body, joints=joints)
