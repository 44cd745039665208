"""Search for limbs of unknown pose in images: the pose whose regions split them best (B eq. 8).

Clothes are alike on both sides, so the colours of a limb are those of its opposite until they are known.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import SegmentName, mirrored
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointLimits

_GENERATIONS = ((200, np.inf), (100, 0.4), (100, 0.2))
"""Poses that are tried of a limb, 2 x 2 ms each, and how far from the best ones before [rad]; anywhere at first."""

_PARENTS, _REFINED = 8, 3  # best poses of a generation that the next one starts from; that are refined in the end
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


def chains_of(body: BodyModel, missing: Mask) -> list[list[int]]:
    """Rows of the joints of each chain of missing segments (S,), from the root outwards; chains end at branches."""
    children = Counter(joint.parent for joint in body.tree_joints if joint.type != "free")
    chains: list[list[int]] = []
    chain_of: dict[str, list[int]] = {}
    for row, joint in enumerate(body.tree_joints):
        if missing[body.segment_index[joint.child]] and joint.type != "free":
            chain = chain_of.get(joint.parent) if children[joint.parent] == 1 else None
            if chain is None:
                chain = []
                chains.append(chain)
            chain.append(row)
            chain_of[joint.child] = chain
    return chains


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
        self._body = body
        self._energy = energy
        self._refine = refine
        limits = JointLimits(body)
        self._angles = limits.angles
        self._low = np.where(np.isfinite(limits.low), limits.low, -_UNKNOWN_RANGE)
        self._high = np.where(np.isfinite(limits.high), limits.high, _UNKNOWN_RANGE)
        self._random = random

    def find(self, poses: Array, chain: list[int]) -> Array:
        """Poses (S, 4, 4) in which a limb, by the rows of its joints, is where the images have it."""
        free = np.isin(self._angles.joint_rows, chain)
        moves = np.flatnonzero(self._body.moves[:, chain].any(axis=1))
        angles = self._angles.angles(self._body.joint_poses(poses), np.zeros(len(free)))[None]
        tried, energies = poses[None], np.array([self._energy(poses)])
        for count, spread in _GENERATIONS:
            best = np.argsort(-energies)[:_PARENTS]
            drawn = angles[self._random.choice(best, count)]
            low, high = np.maximum(self._low, drawn - spread), np.minimum(self._high, drawn + spread)
            drawn[:, free] = self._random.uniform(np.minimum(low, high), high)[:, free]
            bent = self._bent(poses, drawn, moves)
            angles, tried = np.concatenate([angles, drawn]), np.concatenate([tried, bent])
            energies = np.concatenate([energies, [self._energy(each) for each in bent]])
        refined = [self._refine(tried[row]) for row in np.argsort(-energies)[:_REFINED]]
        return max(refined, key=self._energy)

    def _bent(self, poses: Array, angles: Array, moves: NDArray[np.int64]) -> Array:
        """Bodies (N, S, 4, 4) at poses (S, 4, 4) but for the segments ``moves``, which joint angles (N, A) place."""
        root = poses[self._body.segment_index[self._body.root]]
        bent = np.tile(poses, (len(angles), 1, 1, 1))
        bent[:, moves] = self._body.forward_kinematics(root, self._angles.poses(angles))[:, moves]
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
    """The body with limits on the balls of known segments that have none; a range of motion measured its own."""
    joints = []
    for joint in body.joints:
        usual = _USUAL.get(SegmentName(joint.child).kind)
        if joint.type == "ball" and not joint.limits and usual is not None:
            joint = replace(joint, limits=tuple(usual[axis] for axis in joint.angle_axes))
        joints.append(joint)
    return replace(body, joints=tuple(joints))
