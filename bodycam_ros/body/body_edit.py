"""Corrections of a body as pure functions: a body in, the corrected body out; the first is left as it was.

In the N-pose a correction moves one thing and leaves everything else where it was, whatever hangs on it.
"""

from dataclasses import replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.files.shown import other_than
from bodycam_ros.geometry import Array, inverse, rigid
from bodycam_ros.kinematics.joint import Joint


def move_mount(body: BodyModel, camera: str, segment_T_camera: Array) -> BodyModel:
    """The body with a camera strapped elsewhere on its segment.

    Args:
        body: to be corrected.
        camera: its name.
        segment_T_camera: (4, 4) new pose of the optical frame on the segment [m].

    Raises:
        BodyError: the body has no such camera, or the pose is not finite.
    """
    if camera not in body.mounts:
        raise BodyError(f"no camera {camera} on this body; {other_than(camera, body.mounts)}")
    moved = replace(body.mounts[camera], segment_T_camera=segment_T_camera.copy())
    return replace(body, mounts={**body.mounts, camera: moved})


def move_joint(body: BodyModel, name: str, parent_T_joint: Array) -> BodyModel:
    """The body with a joint elsewhere.

    A joint of the tree takes the origin of its child along, because a segment's frame starts at the joint to its
    parent. In the N-pose all cameras, all other joints and the child's axes stay where they were.

    Args:
        body: to be corrected.
        name: of the joint.
        parent_T_joint: (4, 4) new frame of the joint on its parent [m]. A turn of it turns the axis of a hinge and
            the axes that a ball's angles are about; the zero pose stays.

    Raises:
        BodyError: the body has no such joint, or the pose is not finite.
    """
    joint = joint_named(body, name)
    # In the N-pose all joint rotations are the identity.
    parent_T_child = joint.parent_T_joint @ joint.joint_T_child
    if joint in body.loop_joints:
        moved = replace(joint, parent_T_joint=parent_T_joint, child_T_joint=inverse(parent_T_child) @ parent_T_joint)
        return replace(body, joints=tuple(moved if other is joint else other for other in body.joints))

    child_R_parent = parent_T_child[:3, :3].T
    shift = child_R_parent @ (parent_T_joint[:3, 3] - joint.parent_T_joint[:3, 3])
    moved_T_child = rigid(np.eye(3), -shift)  # the child's frame after the correction, and before
    moved_T_joint = rigid(child_R_parent @ parent_T_joint[:3, :3], joint.child_T_joint[:3, 3])

    def corrected(other: Joint) -> Joint:
        if other is joint:
            return replace(joint, parent_T_joint=parent_T_joint, child_T_joint=moved_T_joint)
        if other.parent == joint.child:
            return replace(other, parent_T_joint=moved_T_child @ other.parent_T_joint)
        if other.child == joint.child:
            return replace(other, child_T_joint=moved_T_child @ other.child_T_joint)
        return other

    mounts = {
        camera: replace(mount, segment_T_camera=moved_T_child @ mount.segment_T_camera)
        for camera, mount in body.mounts.items()
        if mount.segment == joint.child
    }
    return replace(body, joints=tuple(map(corrected, body.joints)), mounts={**body.mounts, **mounts})


def joint_named(body: BodyModel, name: str) -> Joint:
    """A joint of the body, of the tree or of a loop.

    Raises:
        BodyError: there is none of that name.
    """
    for joint in body.joints:
        if joint.name == name:
            return joint
    raise BodyError(f"no joint {name} in this body; {other_than(name, (joint.name for joint in body.joints))}")
