"""How far people turn their joints, for bodies that do not say: static cameras see no turn of a limb about itself."""

from dataclasses import replace

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anatomy import SegmentName
from bodycam_ros.kinematics.joint import Joint

_USUAL = {
    "torso": {"x": (-0.6, 0.6), "y": (-0.5, 1.0), "z": (-0.8, 0.8)},
    "head": {"x": (-0.7, 0.7), "y": (-0.9, 0.9), "z": (-1.3, 1.3)},
    "forearm": {"x": (-0.15, 0.15), "y": (-2.6, 0.15), "z": (-0.15, 0.15)},
    "thigh": {"x": (-0.9, 0.9), "y": (-2.2, 0.6), "z": (-0.8, 0.8)},
    "shin": {"x": (-0.1, 0.1), "y": (-0.1, 2.6), "z": (-0.1, 0.1)},
    "foot": {"x": (-0.5, 0.5), "y": (-0.9, 0.9), "z": (-0.5, 0.5)},
}
"""Kind of segment -> [rad] about the axes of the joint that it hangs on. A shoulder turns nearly anywhere."""


def with_usual_limits(body: BodyModel) -> BodyModel:
    """The body with limits on the balls of known segments that have none; a range of motion knows better."""
    return replace(body, joints=tuple(_limited(joint) for joint in body.joints))


def _limited(joint: Joint) -> Joint:
    usual = _USUAL.get(SegmentName(joint.child).kind)
    if joint.type != "ball" or joint.limits or usual is None:
        return joint
    return replace(joint, limits=tuple(usual[axis] for axis in joint.angle_axes))
