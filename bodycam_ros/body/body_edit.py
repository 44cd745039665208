"""Corrections of a body as pure functions: a body in, the corrected body out; the first is left as it was.

In the N-pose a correction moves one thing and leaves everything else where it was, whatever hangs on it.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
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
        raise BodyError(f"no camera {camera} on this body; there are {', '.join(body.mounts) or 'none'}")
    moved = replace(body.mounts[camera], segment_T_camera=segment_T_camera.copy())
    return replace(body, mounts={**body.mounts, camera: moved})


def move_joint(body: BodyModel, name: str, parent_T_joint: Array) -> BodyModel:
    """The body with a joint elsewhere.

    A joint of the tree takes the origin of its child along, because a segment's frame starts at the joint to its
    parent (DESIGN 3). In the N-pose all cameras, all other joints and the child's axes stay where they were.

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
        child_T_joint = inverse(parent_T_child) @ parent_T_joint
        return _with_joints(body, lambda other: _placed(other, parent_T_joint, child_T_joint, other is joint))

    shift = parent_T_child[:3, :3].T @ (parent_T_joint[:3, 3] - joint.parent_T_joint[:3, 3])
    moved_T_child = rigid(np.eye(3), -shift)  # the child's frame after the correction, and before
    child_R_joint = parent_T_child[:3, :3].T @ parent_T_joint[:3, :3]
    moved_T_joint = rigid(child_R_joint, joint.child_T_joint[:3, 3])

    def corrected(other: Joint) -> Joint:
        if other is joint:
            return _placed(other, parent_T_joint, moved_T_joint)
        other = _placed(other, moved_T_child @ other.parent_T_joint, other.child_T_joint, other.parent == joint.child)
        return _placed(other, other.parent_T_joint, moved_T_child @ other.child_T_joint, other.child == joint.child)

    mounts = {
        camera: replace(mount, segment_T_camera=moved_T_child @ mount.segment_T_camera)
        if mount.segment == joint.child
        else mount
        for camera, mount in body.mounts.items()
    }
    return replace(_with_joints(body, corrected), mounts=mounts)


def joint_named(body: BodyModel, name: str) -> Joint:
    """A joint of the body, of the tree or of a loop.

    Raises:
        BodyError: there is none of that name.
    """
    for joint in body.joints:
        if joint.name == name:
            return joint
    raise BodyError(f"no joint {name} in this body; there are {', '.join(j.name for j in body.joints) or 'none'}")


def _with_joints(body: BodyModel, corrected: Callable[[Joint], Joint]) -> BodyModel:
    return replace(body, joints=tuple(corrected(joint) for joint in body.joints))


def _placed(joint: Joint, parent_T_joint: Array, child_T_joint: Array, concerned: bool = True) -> Joint:
    """The joint at another place if it is concerned."""
    if not concerned:
        return joint
    # A new joint, because the old one remembers what it derived from its place.
    return replace(joint, parent_T_joint=parent_T_joint, child_T_joint=child_T_joint)
