"""A first body from joint centres, virtual cameras and the N-pose (A eq. 15), before refinement.

In the N-pose all segments have the same axes, x forward, y left, z up, and each begins at the joint that it hangs on
(DESIGN 3); this fixes every frame.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.segment_name import LEFT, SegmentName, mirrored
from bodycam_ros.calibration.joint_centre import JointCentre
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.geometry import rigid
from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]


def first_body(
    name: str,
    rig: Rig,
    centres: Mapping[str, JointCentre],
    virtual_T_camera: Mapping[str, Array],
    rest_T_virtual: Mapping[str, Array],
) -> BodyModel:
    """The body whose zero is the N-pose.

    Args:
        name: of the body.
        rig: cameras and segments.
        centres: child segment -> its joint, in the frames of the virtual cameras.
        virtual_T_camera: camera -> (4, 4) its place at its segment's virtual camera.
        rest_T_virtual: segment -> (4, 4) pose of its virtual camera in the N-pose; the rotation in the N-pose's axes.
    """
    # A eq. 15 in every segment's own axes: from the joint that it hangs on to the ones that hang on it.
    origins = {segment: centre.in_child for segment, centre in centres.items()}
    on_root = [centre.in_parent for child, centre in centres.items() if rig.parents[child] == rig.root]
    origins[rig.root] = np.mean(on_root, axis=0)
    joints = []
    for child, centre in centres.items():
        parent = str(rig.parents[child])
        offset = rest_T_virtual[parent][:3, :3] @ (centre.in_parent - origins[parent])
        called = SegmentName(child)
        joints.append(
            Joint(called.joint, parent, child, "ball", rigid(np.eye(3), offset), angle_axes=called.angle_axes)
        )
    mounts = {}
    for camera, segment in rig.cameras.items():
        segment_R_virtual = rest_T_virtual[segment][:3, :3]
        segment_T_virtual = rigid(segment_R_virtual, -segment_R_virtual @ origins[segment])
        mounts[camera] = CameraMount(segment, segment_T_virtual @ virtual_T_camera[camera])
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
