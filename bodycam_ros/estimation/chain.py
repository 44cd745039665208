"""One state of the chain: its measurements, its estimate, and what its publication waits for."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyUncertainty, SegmentPose
from bodycam_ros.estimation.attachments import ActiveAttachments
from bodycam_ros.estimation.estimate import Coordinates, Estimate, Transition
from bodycam_ros.estimation.measurements import JointRotations, Measurements
from bodycam_ros.geometry import Array, inverse, nearest_rotation
from bodycam_ros.kinematics.joint_angles import JointLimits

Mask = NDArray[np.bool_]


@dataclass(eq=False)
class ChainState:
    """One state of the chain.

    Attributes:
        stamp_ns: its time [ns].
        stamps_ns: camera -> stamp of its own image [ns].
        link: to the state before, given all measurements until then.
        measured: measurements of this state.
        joints_observed: (J,) whether body cameras observe both segments.
        turning: (J,) whether the rotations of both are measured at least.
        by_static: joints that static cameras observe.
        observed: (S,) whether a body camera on the segment, or a static camera, observes it.
        cameras_used: accepted cameras.
        uncertainty: of the estimate.
        active: which attachments of equipment are; None without equipment, or before it is placed.
        unobserved: (J,) joints that a later frame may still determine, by the rotations measured until then.
        is_unmeasured: whether neither this state nor a later one was observed.
        is_published: whether it has been published.
    """

    stamp_ns: int
    stamps_ns: Mapping[str, int]
    link: Transition
    measured: Measurements
    joints_observed: Mask
    turning: Mask
    by_static: JointRotations
    observed: Mask
    cameras_used: int
    uncertainty: BodyUncertainty
    active: ActiveAttachments | None
    unobserved: Mask = field(init=False)
    is_unmeasured: bool = field(init=False)
    is_published: bool = False

    def __post_init__(self) -> None:
        self.unobserved, self.is_unmeasured = ~self.joints_observed, not self.is_observed

    @property
    def estimate(self) -> Estimate:
        """The state given all measurements until then."""
        return self.link.after

    @property
    def is_observed(self) -> bool:
        """Whether any camera was accepted."""
        return bool(self.observed.any())

    @property
    def is_waiting(self) -> bool:
        """Whether later frames may still determine what was not observed."""
        return self.is_unmeasured or bool(self.unobserved.any())

    def follow(self, latest: "ChainState") -> None:
        """Update what it waits for by a later state."""
        self.unobserved &= latest.turning & ~latest.joints_observed
        self.is_unmeasured = self.is_unmeasured and not latest.is_observed


def smooth(states: Sequence[ChainState]) -> list[Coordinates]:
    """Coordinates of states given all of them: the last one, carried back to the first (Rauch, Tung, Striebel 1965)."""
    smoothed = [states[-1].estimate.at]
    for later in reversed(states[1:]):
        smoothed.append(later.link.smoothed(smoothed[-1]))
    return smoothed[::-1]


def first_poses(body: BodyModel, evidence: Collection[SegmentPose], bent: float = 0.0) -> Array:
    """Poses (S, 4, 4) of a body of which some segments are measured; joints between these need not be closed.

    Args:
        body: segments and joints.
        evidence: the measured segments.
        bent: how far the other joints are from the N-pose, as a share of the way to the middle of their limits.
    """
    poses: dict[str, Array] = {}
    motion = np.broadcast_to(np.eye(4), (len(body.tree_joints), 4, 4)).copy()
    motion[:, :3, :3] = JointLimits(body).middle(bent)
    for measured in evidence:
        poses.setdefault(measured.segment, measured.world_T_segment)
    joints = tuple(zip(body.tree_joints, motion, strict=True))
    while len(poses) < len(body.segments):
        for joint, joint_T_moved in (*joints, *reversed(joints)):
            parent_T_child = joint.parent_T_joint @ joint_T_moved @ joint.joint_T_child
            if joint.parent in poses and joint.child not in poses:
                poses[joint.child] = poses[joint.parent] @ parent_T_child
            elif joint.child in poses and joint.parent not in poses:
                poses[joint.parent] = poses[joint.child] @ inverse(parent_T_child)
    all_poses = np.stack([poses[segment] for segment in body.segments])
    all_poses[:, :3, :3] = nearest_rotation(all_poses[:, :3, :3])
    return all_poses
