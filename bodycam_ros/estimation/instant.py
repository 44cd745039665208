"""One instant of the chain: what was measured, what is believed of it, and what its state still waits for."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyUncertainty, SegmentPose
from bodycam_ros.estimation.attachment_watch import Holding
from bodycam_ros.estimation.belief import Belief, Link
from bodycam_ros.estimation.looking_on import ToldJoints
from bodycam_ros.estimation.measurements import Measured
from bodycam_ros.estimation.motion_model import Between
from bodycam_ros.geometry import Array, inverse, nearest_rotation
from bodycam_ros.kinematics.tangent import TreeTangent

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Step:
    """How an instant follows from the one before, until it is measured itself.

    Attributes:
        dt_s: between the two [s]; 0 at the first.
        after: the later instant as it is expected.
        link: the two; None at the first.
        density, fade_s: of the motion between them, as ``MotionModel.predict`` takes them.
        between: what was measured of both.
    """

    dt_s: float
    after: Belief
    link: Link | None = None
    density: Array | None = None
    fade_s: Array | None = None
    between: Sequence[Between] = ()

    def linked(self, link: Link) -> "Step":
        """The same, with more known of the two."""
        return replace(self, link=link, after=link.after)


@dataclass(eq=False)
class Instant:
    """What is kept of an instant.

    Attributes:
        stamp_ns: when it is [ns].
        stamps_ns: camera -> stamp of its own image [ns].
        belief: given all that was measured until then.
        step: from the instant before.
        measured: at it, of the cameras that are believed.
        joints_seen: (J,) whether worn cameras see both segments.
        turning: (J,) whether the rotations of both are measured at least.
        told: joints that static cameras see.
        observed: (S,) whether a camera on the segment, or one that looks at it, is believed.
        cameras_used: how many are.
        uncertainty: of the belief.
        holding: which attachments of equipment hold.
        unseen: (J,) joints that later images may still tell, by their turns until they are seen.
        is_silent: whether nothing was measured, and nothing has been since.
        is_published: whether its state has gone out.
    """

    stamp_ns: int
    stamps_ns: Mapping[str, int]
    belief: Belief
    step: Step
    measured: Measured
    joints_seen: Mask
    turning: Mask
    told: ToldJoints
    observed: Mask
    cameras_used: int
    uncertainty: BodyUncertainty
    holding: Holding | None
    unseen: Mask = field(init=False)
    is_silent: bool = field(init=False)
    is_published: bool = False

    def __post_init__(self) -> None:
        self.unseen, self.is_silent = ~self.joints_seen, not self.is_observed

    @property
    def is_observed(self) -> bool:
        """Whether any camera spoke and is believed."""
        return bool(self.observed.any())

    @property
    def is_waiting(self) -> bool:
        """Whether later images may still tell what nothing saw."""
        return self.is_silent or bool(self.unseen.any())

    def follow(self, latest: "Instant") -> None:
        """Take note of an instant after it."""
        self.unseen &= latest.turning & ~latest.joints_seen
        self.is_silent = self.is_silent and not latest.is_observed


def smoothed(instants: Sequence[Instant], tangent: TreeTangent) -> list[Belief]:
    """What is known of instants given all of them: the last one's belief, carried back to the first."""
    beliefs = [instants[-1].belief]
    for later in reversed(instants[1:]):
        assert later.step.link is not None  # only the first has none
        beliefs.append(later.step.link.smoothed(tangent, beliefs[-1], covariance=False))
    return beliefs[::-1]


def first_poses(body: BodyModel, evidence: Collection[SegmentPose]) -> Array:
    """Poses (S, 4, 4) of a body of which some segments are seen; joints between these need not be closed."""
    poses: dict[str, Array] = {}
    for seen in evidence:
        poses.setdefault(seen.segment, seen.world_T_segment)
    joints = body.tree_joints
    while len(poses) < len(body.segments):
        for joint in (*joints, *reversed(joints)):
            parent_T_child = joint.parent_T_joint @ joint.joint_T_child
            if joint.parent in poses and joint.child not in poses:
                poses[joint.child] = poses[joint.parent] @ parent_T_child
            elif joint.child in poses and joint.parent not in poses:
                poses[joint.parent] = poses[joint.child] @ inverse(parent_T_child)
    all_poses = np.stack([poses[segment] for segment in body.segments])
    all_poses[:, :3, :3] = nearest_rotation(all_poses[:, :3, :3])
    return all_poses
