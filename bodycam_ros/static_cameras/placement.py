"""A body that a person places before static cameras, segment by segment, within the range of motion of its joints.

The root moves the whole body. Any other segment takes its parents along as a limb: an ankle that is moved bends hip and
knee, a wrist shoulder and elbow, the head leans the torso. A head or foot keeps its direction meanwhile, as far as its
joint allows, a hand its wrist's angle; an elbow or knee swings around while the hand or foot stays.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.geometry import Array, exp_so3, inverse, rigid
from bodycam_ros.kinematics.joint_angles import JointLimits
from bodycam_ros.static_cameras.limb_search import chains_of
from bodycam_ros.static_cameras.static_camera import StaticCamera

_REACH_M, _END_M, _BEND_RAD = 0.01, 0.1, 2.0
"""Sigmas of the place that a segment is moved to, of where its far end was, and of angles about those before."""

_UNBEND = 0.1  # share of the way to the middle of its limits that a joint is bent first: straight, it has no direction
_STILL_M = 1e-5  # that handles differ from where they were put
_IN_FRONT_M, _IN_FRONT_WEIGHT = 3.0, 0.01  # of a camera, where its axis meets no other; and how little that counts


@dataclass(frozen=True, eq=False)
class Placement:
    """A body where it is placed.

    Attributes:
        body: segments and joints with their limits.
        poses: (S, 4, 4) of its segments in the world, joints closed.
    """

    body: BodyModel
    poses: Array

    def pose_of(self, segment: str) -> Array:
        """(4, 4) present pose of a segment."""
        pose: Array = self.poses[self.body.segment_index[segment]]
        return pose

    def can_move(self, segment: str) -> bool:
        """Whether a segment's origin can be moved; the others only turn."""
        return segment == self.body.root or bool(self._limb(segment))

    def moved_to(self, segment: str, world_T_segment: Array) -> "Placement":
        """The placement with a segment as near to a pose (4, 4) [m] as its limb's joints allow."""
        before, row = self.poses, self.body.segment_index[segment]
        if segment == self.body.root:
            return replace(self, poses=world_T_segment @ inverse(before[row]) @ before)
        place = world_T_segment[:3, 3]
        is_moved = not np.allclose(before[row, :3, 3], place, rtol=0.0, atol=_STILL_M)
        limb, places = self._limb(segment) if is_moved else [], {row: (place, _REACH_M)}
        ends = [child for parent, child in self.body.joint_ends.tolist() if parent == row]
        bends = bool(limb) and len(ends) == 1
        if bends:
            places[ends[0]] = before[ends[0], :3, 3], _END_M
            limb = [*limb, self._own_joint(row)]
        poses = self._reached(before, limb, places)
        if not bends and not (limb and SegmentName(segment).kind == "hand"):
            poses = self._turned(poses, row, world_T_segment[:3, :3])
        return replace(self, poses=poses)

    def _reached(self, before: Array, limb: Sequence[int], places: Mapping[int, tuple[Array, float]]) -> Array:
        """Poses in which joints, by their rows, bring segments to places: row -> place (3,) and its sigma [m]."""
        limits, rows = self._limits, [*places]
        root = before[self.body.segment_index[self.body.root]]
        angles = limits.nearest_angles(self.body.joint_poses(before))
        free = np.isin(limits.angles.joint_rows, limb)
        if not free.any():
            return before
        low, high = limits.low[free], limits.high[free]
        first = np.clip(angles[free], low, high)
        bounded = np.isfinite(high - low)
        begin = first.copy()
        begin[bounded] += _UNBEND * (0.5 * (low[bounded] + high[bounded]) - first[bounded])
        wanted, sigmas = (np.array(column) for column in zip(*places.values(), strict=True))

        def poses(bent: Array) -> Array:
            angles[free] = bent
            return limits.angles.forward_kinematics(root, angles)

        def errors(bent: Array) -> Array:
            off = (poses(bent)[rows, :3, 3] - wanted) / sigmas[:, None]
            return np.concatenate([off.ravel(), (bent - first) / _BEND_RAD])

        return poses(least_squares(errors, begin, bounds=(low, high), max_nfev=30).x)

    def _turned(self, poses: Array, row: int, world_R_segment: Array) -> Array:
        """Poses with the segment of a row turned to a rotation (3, 3), or as near as its joint allows."""
        wanted = poses.copy()
        wanted[row, :3, :3] = world_R_segment
        motion, own = self.body.joint_poses(poses), self._own_joint(row)
        motion[own, :3, :3] = self._limits.clamp(self.body.joint_rotations(wanted))[own]
        return self.body.forward_kinematics(poses[self.body.segment_index[self.body.root]], motion)

    def _own_joint(self, row: int) -> int:
        """Row of the joint that a segment hangs on."""
        return int(np.flatnonzero(self.body.joint_ends[:, 1] == row)[0])

    def _limb(self, segment: str) -> list[int]:
        """Rows of the joints that move a segment's origin: of its parent, and further in while nothing branches off."""
        above = {joint.child: row for row, joint in enumerate(self.body.tree_joints)}
        inner = above.get(self.body.tree_joints[above[segment]].parent) if segment in above else None
        chains = chains_of(self.body, np.ones(len(self.body.segments), bool))
        return next((chain[: chain.index(inner) + 1] for chain in chains if inner in chain), [])

    @cached_property
    def _limits(self) -> JointLimits:
        return JointLimits(self.body)


def standing_in_view(body: BodyModel, stations: Collection[StaticCamera]) -> Array:
    """Poses (S, 4, 4) of a body in its N-pose where the cameras' axes come nearest to each other, facing the first.

    A place some metres before each camera counts a little, too.
    """
    poses = np.array([station.world_T_camera for station in stations])
    cameras, ahead = poses[:, :3, 3:], poses[:, :3, 2:3]
    across = np.eye(3) - ahead @ ahead.swapaxes(1, 2)
    b = across @ cameras + _IN_FRONT_WEIGHT * (cameras + _IN_FRONT_M * ahead)
    centre = np.linalg.solve((across + _IN_FRONT_WEIGHT * np.eye(3)).sum(axis=0), b.sum(axis=0))[:, 0]
    x, y, _ = cameras[0, :, 0] - centre
    return body.n_pose(rigid(exp_so3(np.array([0.0, 0.0, np.arctan2(y, x)])), centre))
