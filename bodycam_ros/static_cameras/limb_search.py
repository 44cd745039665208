"""Limbs that nobody knows the pose of, looked for in images: the pose whose regions split them best (B eq. 8).

Clothes are alike on both sides, so the colours of a limb are those of its opposite until they are learned.

What the solver says is right, but old; what one station saw since is new, but of one side only. So the body goes on
from where the solver has it by the steps that the station saw it make, and from there at constant velocity.
"""

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyNow
from bodycam_ros.calibration.anthropometry import SegmentName, mirrored
from bodycam_ros.estimation.motion_model import MotionSettings, orthonormal, predict
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.joint_angles import JointLimits

_POSES = 400  # that are tried of a limb: 2 x 2 ms each
_REFINED = 3  # best ones that are refined
_UNKNOWN_RANGE = 1.0  # [rad] to either side, where no limits are known

Mask = NDArray[np.bool_]


def colours_from(body: BodyModel, unknown: Mask) -> dict[int, int]:
    """Row of a segment of unknown colours (S,) -> row of the one that has them: its opposite, else its parent."""
    known = {segment for row, segment in enumerate(body.segments) if not unknown[row]}
    source = {}
    for joint in body.tree_joints:
        opposite = mirrored(joint.child)
        if joint.child not in known:
            alike = opposite if opposite in known else joint.parent
            if alike in known:
                source[body.segment_index[joint.child]] = body.segment_index[alike]
    return source


class LimbSearch:
    """Tries poses of limbs.

    Args:
        body: joints and their limits.
        energy: how well poses (S, 4, 4) split all images; more is better.
        refine: poses (S, 4, 4) near the given ones that split them better.
        random: chooses the poses that are tried.
    """

    def __init__(
        self,
        body: BodyModel,
        energy: Callable[[Array], float],
        refine: Callable[[Array], Array],
        random: np.random.Generator,
    ) -> None:
        self._body, self._energy, self._refine = body, energy, refine
        limits = JointLimits(body)
        self._angles = limits.angles
        self._low = np.where(np.isfinite(limits.low), limits.low, -_UNKNOWN_RANGE)
        self._high = np.where(np.isfinite(limits.high), limits.high, _UNKNOWN_RANGE)
        self._random = random

    def find(self, poses: Array, lost: Mask) -> Array:
        """Poses (S, 4, 4) in which the lost segments (S,) are where the images have them; the others stay."""
        for limb in self.limbs(lost):
            poses = self.find_limb(poses, limb)
        return poses

    def find_limb(self, poses: Array, limb: list[int]) -> Array:
        """Poses (S, 4, 4) in which a limb, by the rows of its joints, is where the images have it."""
        tried = np.concatenate([poses[None], self._bent(poses, limb)])
        best = np.argsort([-self._energy(each) for each in tried])[:_REFINED]
        return max((self._refine(tried[place]) for place in best), key=self._energy)

    def limbs(self, lost: Mask) -> list[list[int]]:
        """Rows of the joints of each chain of lost segments, from the root outwards; a chain ends where it branches."""
        joints = self._body.tree_joints
        children = Counter(joint.parent for joint in joints if joint.type != "free")
        limbs: list[list[int]] = []
        limb_of: dict[str, list[int]] = {}
        for row, joint in enumerate(joints):
            if lost[self._body.segment_index[joint.child]] and joint.type != "free":
                limb = limb_of.get(joint.parent) if children[joint.parent] == 1 else None
                if limb is None:
                    limb = []
                    limbs.append(limb)
                limb.append(row)
                limb_of[joint.child] = limb
        return limbs

    def _bent(self, poses: Array, limb: list[int]) -> Array:
        """Bodies (N, S, 4, 4) at poses (S, 4, 4) but for a limb that is bent somehow within its limits."""
        body, index = self._body, self._body.segment_index
        free = np.isin(self._angles.joint_rows, limb)
        angles = np.tile(self._angles.angles(body.joint_poses(poses), np.zeros(len(free))), (_POSES, 1))
        angles[:, free] = self._random.uniform(self._low[free], self._high[free], (_POSES, free.sum()))
        moved = body.forward_kinematics(poses[index[body.root]], self._angles.poses(angles))
        moves = np.flatnonzero(body.moves[:, limb].any(axis=1))
        bent = np.tile(poses, (_POSES, 1, 1, 1))
        bent[:, moves] = moved[:, moves]
        return bent


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


_REMEMBERED = 100
"""Steps and poses: some seconds, more than a solver is behind."""

_LONGEST_S = 0.5
"""For so long a body goes on by itself; after a longer pause it is looked for where it was."""


@dataclass(frozen=True, eq=False)
class _Step:
    """How a station saw the body move: poses at the end are those at the beginning @ motion (S, 4, 4)."""

    begin_ns: int
    end_ns: int
    motion: Array

    @property
    def seconds(self) -> float:
        return 1e-9 * (self.end_ns - self.begin_ns)

    def after(self, stamp_ns: int) -> Array:
        """The part of the motion that comes after a time."""
        share = (self.end_ns - max(stamp_ns, self.begin_ns)) / (self.end_ns - self.begin_ns)
        return self.motion if share >= 1.0 else exp_se3(share * log_se3(self.motion))


class CarriedBody:
    """Carries a body on from what is heard and seen of it.

    Args:
        motion: how a velocity fades.
    """

    def __init__(self, motion: MotionSettings) -> None:
        self._motion = motion
        self._heard: deque[BodyNow] = deque(maxlen=_REMEMBERED)
        self._steps: deque[_Step] = deque(maxlen=_REMEMBERED)
        self._found: tuple[int, Array] | None = None

    def hear(self, body: BodyNow) -> None:
        """Where the body was; what was said of a later time is forgotten: time has begun anew."""
        while self._heard and self._heard[-1].stamp_ns >= body.stamp_ns:
            self._heard.pop()
        self._heard.append(body)

    def find(self, stamp_ns: int, world_T_segment: Array) -> None:
        """The station has found the body at poses (S, 4, 4), later than the time before."""
        latest = self._latest(stamp_ns)
        if latest is not None and latest[0] < stamp_ns:
            self._steps.append(_Step(latest[0], stamp_ns, inverse(latest[1]) @ world_T_segment))
        self._found = stamp_ns, world_T_segment

    def heard_by(self, stamp_ns: int) -> BodyNow | None:
        """The latest that was heard of a time not after this one."""
        return next((body for body in reversed(self._heard) if body.stamp_ns <= stamp_ns), None)

    def at(self, stamp_ns: int) -> tuple[Array, float] | None:
        """Poses (S, 4, 4) at a time, and for how long the body goes on by itself until then [s]; None if unknown."""
        latest = self._latest(stamp_ns)
        if latest is None:
            return None
        latest_ns, poses = latest
        ahead_s = 1e-9 * (stamp_ns - latest_ns)
        if ahead_s > _LONGEST_S:
            return poses, _LONGEST_S
        before = self.heard_by(latest_ns - 1)
        heard = self.heard_by(latest_ns)
        if heard is not None and heard.stamp_ns == latest_ns:
            if before is None:
                return poses, ahead_s
            before_s = 1e-9 * (latest_ns - before.stamp_ns)
            return predict(before.world_T_segment, poses, before_s, ahead_s), ahead_s
        if not self._steps:
            return poses, ahead_s
        step = self._steps[-1]
        return predict(poses @ inverse(step.motion), poses, step.seconds, ahead_s), ahead_s

    def _latest(self, stamp_ns: int) -> tuple[int, Array] | None:
        """The latest time up to this one of which something is known, and the poses (S, 4, 4) then."""
        heard = self.heard_by(stamp_ns)
        if heard is None:
            return self._found
        if self._found is None or self._found[0] <= heard.stamp_ns:
            return heard.stamp_ns, heard.world_T_segment
        if not self._steps or heard.stamp_ns < self._steps[0].begin_ns:
            return self._found
        poses = heard.world_T_segment
        for step in self._steps:
            if step.end_ns > heard.stamp_ns:
                poses = poses @ step.after(heard.stamp_ns)
        return self._found[0], orthonormal(poses)
