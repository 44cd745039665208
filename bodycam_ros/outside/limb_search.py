"""Limbs that nobody knows the pose of, looked for in images: the pose whose regions split them best (B eq. 8).

Clothes are alike on both sides, so the colours of a limb are those of its opposite until they are learned.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint_angles import JointAngles, angle_limits
from bodycam_ros.calibration.anatomy import mirrored
from bodycam_ros.geometry import Array

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
        self._angles = JointAngles(body)
        low, high = angle_limits(body)
        self._low = np.where(np.isfinite(low), low, -_UNKNOWN_RANGE)
        self._high = np.where(np.isfinite(high), high, _UNKNOWN_RANGE)
        self._joint_of_angle = np.repeat(
            np.arange(len(body.tree_joints)), [len(joint.angle_names) for joint in body.tree_joints]
        )
        self._random = random

    def find(self, poses: Array, lost: Mask) -> Array:
        """Poses (S, 4, 4) in which the lost segments (S,) are where the images have them; the others stay."""
        for limb in self._limbs(lost):
            tried = [poses, *(self._bent(poses, limb) for _ in range(_POSES))]
            best = np.argsort([-self._energy(each) for each in tried])[:_REFINED]
            poses = max((self._refine(tried[place]) for place in best), key=self._energy)
        return poses

    def _limbs(self, lost: Mask) -> Iterator[list[int]]:
        """Rows of the joints of each limb that is lost, from where it hangs on what is not."""
        limb_of: dict[str, list[int]] = {}
        for row, joint in enumerate(self._body.tree_joints):
            if lost[self._body.segment_index[joint.child]] and joint.type != "free":
                limb = limb_of.get(joint.parent, [])
                limb.append(row)
                limb_of[joint.child] = limb
        seen: list[list[int]] = []
        for limb in limb_of.values():
            if not any(limb is other for other in seen):
                seen.append(limb)
        yield from seen

    def _bent(self, poses: Array, limb: list[int]) -> Array:
        """The body with a limb bent somehow within its limits."""
        angles = self._angles.angles(self._body.joint_poses(poses), np.zeros(len(self._low)))
        free = np.isin(self._joint_of_angle, limb)
        angles[free] = self._random.uniform(self._low[free], self._high[free])
        moved = self._body.forward_kinematics(
            poses[self._body.segment_index[self._body.root]], self._angles.poses(angles)
        )
        keeps = np.ones(len(poses), bool)
        keeps[[self._body.segment_index[self._body.tree_joints[row].child] for row in limb]] = False
        return np.where(keeps[:, None, None], poses, moved)
