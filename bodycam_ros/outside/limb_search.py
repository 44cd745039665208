"""Limbs that nobody knows the pose of, looked for in images: the pose whose regions split them best (B eq. 8).

Clothes are alike on both sides, so the colours of a limb are those of its opposite until they are learned.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anatomy import mirrored
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.limits import JointLimits

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
        for limb in self._limbs(lost):
            tried = np.concatenate([poses[None], self._bent(poses, limb)])
            best = np.argsort([-self._energy(each) for each in tried])[:_REFINED]
            poses = max((self._refine(tried[place]) for place in best), key=self._energy)
        return poses

    def _limbs(self, lost: Mask) -> Iterator[list[int]]:
        """Rows of the joints of each limb that is lost, from where it hangs on what is not."""
        first_of: dict[str, str] = {}  # of a lost segment: the first one of its limb
        limbs: dict[str, list[int]] = {}
        for row, joint in enumerate(self._body.tree_joints):
            if lost[self._body.segment_index[joint.child]] and joint.type != "free":
                first_of[joint.child] = first_of.get(joint.parent, joint.child)
                limbs.setdefault(first_of[joint.child], []).append(row)
        yield from limbs.values()

    def _bent(self, poses: Array, limb: list[int]) -> Array:
        """Bodies (N, S, 4, 4) at poses (S, 4, 4) but for a limb that is bent somehow within its limits."""
        body, index = self._body, self._body.segment_index
        free = np.isin(self._angles.joint_rows, limb)
        angles = np.tile(self._angles.angles(body.joint_poses(poses), np.zeros(len(free))), (_POSES, 1))
        angles[:, free] = self._random.uniform(self._low[free], self._high[free], (_POSES, free.sum()))
        moved = body.forward_kinematics(poses[index[body.root]], self._angles.poses(angles))
        moves = [index[body.tree_joints[row].child] for row in limb]
        bent = np.tile(poses, (_POSES, 1, 1, 1))
        bent[:, moves] = moved[:, moves]
        return bent
