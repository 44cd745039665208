"""A first body from joint centres and virtual cameras (A eq. 15), before refinement."""

from dataclasses import replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.segment_name import LEFT, SegmentName, mirrored
from bodycam_ros.calibration.joint_search import FoundJoints
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.geometry import rigid
from bodycam_ros.kinematics.joint import Joint


def first_body(name: str, rig: Rig, found: FoundJoints) -> BodyModel:
    """The body whose segments have the axes of their virtual cameras, and begin at the joints that they hang on.

    Args:
        name: of the body.
        rig: cameras and segments.
        found: joints and virtual cameras.
    """
    # A eq. 15: from the joint that a segment hangs on to the ones that hang on it.
    origins = {segment: centre.in_child for segment, centre in found.centres.items()}
    on_root = [centre.in_parent for child, centre in found.centres.items() if rig.parents[child] == rig.root]
    origins[rig.root] = np.mean(on_root, axis=0)
    joints = []
    for child, centre in found.centres.items():
        called, parent = SegmentName(child), str(rig.parents[child])
        place = rigid(np.eye(3), centre.in_parent - origins[parent])
        joints.append(Joint(called.joint, parent, child, "ball", place, angle_axes=called.angle_axes))
    mounts = {
        camera: CameraMount(segment, rigid(np.eye(3), -origins[segment]) @ one.virtual_T_camera[camera])
        for segment, one in found.virtual.items()
        for camera in one.virtual_T_camera
    }
    return BodyModel(name, rig.root, rig.segments, tuple(joints), mounts)


def root_at_hips(body: BodyModel) -> BodyModel:
    """The body with the root's origin midway between its paired joints, the hips (DESIGN 3)."""
    place_of = {joint.name: joint.parent_T_joint[:3, 3] for joint in body.joints if joint.parent == body.root}
    both = [(name, mirrored(name)) for name in place_of if name.endswith(LEFT)]
    paired = [0.5 * (place_of[left] + place_of[right]) for left, right in both if right in place_of]
    if not paired:
        return body
    new_T_old = rigid(np.eye(3), -np.mean(paired, axis=0))
    joints = tuple(
        replace(joint, parent_T_joint=new_T_old @ joint.parent_T_joint) if joint.parent == body.root else joint
        for joint in body.joints
    )
    mounts = {
        camera: replace(mount, segment_T_camera=new_T_old @ mount.segment_T_camera)
        for camera, mount in body.mounts.items()
        if mount.segment == body.root
    }
    return replace(body, joints=joints, mounts={**body.mounts, **mounts})
