"""The factors of one instant of the body (A eq. 8, 10-11): gtsam's native ones only, so that it never calls back."""

from collections.abc import Collection, Iterable, Mapping

import gtsam
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import inverse, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.solving.camera_evidence import SegmentPose, SegmentTurn
from bodycam_ros.solving.expected_joints import ExpectedJoints
from bodycam_ros.solving.held_joint import HeldJoint
from bodycam_ros.solving.joint_poses import JointPoses

_NO_OPINION_M = 10.0
"""Sigma of the translation of a factor that speaks of rotation only."""


_SOFT_M = 1e-3
"""Sigma of an unseen joint's place: next to a limb that may be anywhere, one of 0.1 mm is too stiff for Cholesky."""


class BodyFactors:
    """Collects the factors that a new instant brings.

    Args:
        body: segments and joints.
        outlier_sigmas: scale of the Cauchy kernel on registrations.
        coupled: names of the joints that a ``Coupling`` speaks for: of the equipment, to it and beside it.
    """

    def __init__(self, body: BodyModel, outlier_sigmas: float, coupled: Collection[str] = ()) -> None:
        self._body = body
        self._kernel = gtsam.noiseModel.mEstimator.Cauchy.Create(outlier_sigmas)
        self._coupled = [joint.name in coupled for joint in body.joints]
        self._joint_noises = [(_noise(joint, 0.0), _noise(joint, _SOFT_M)) for joint in body.joints]
        self._joint_poses = JointPoses(body)
        tree_row = {joint.name: row for row, joint in enumerate(body.tree_joints)}
        self._tree_rows = [tree_row.get(joint.name, -1) for joint in body.joints]

    def key(self, index: int, row: int) -> int:
        """Variable of a segment (its row in the body) at an instant."""
        return index * len(self._body.segments) + row

    def keys(self, index: int) -> list[int]:
        """Variables of all segments at an instant."""
        return [self.key(index, row) for row in range(len(self._body.segments))]

    def cameras(self, index: int, evidence: Iterable[SegmentPose]) -> gtsam.NonlinearFactorGraph:
        """E_r of A eq. 8: each camera's reprojection errors, condensed to its pose and information."""
        graph = gtsam.NonlinearFactorGraph()
        for seen in evidence:
            noise = gtsam.noiseModel.Robust.Create(self._kernel, gtsam.noiseModel.Gaussian.Covariance(seen.covariance))
            key = self.key(index, self._body.segment_index[seen.segment])
            graph.add(gtsam.PriorFactorPose3(key, gtsam.Pose3(seen.world_T_segment), noise))
        return graph

    def turns(self, index: int, turns: Iterable[tuple[int, SegmentTurn]]) -> gtsam.NonlinearFactorGraph:
        """Second term of A eq. 8: rotations since earlier instants hold the segments that no camera is registered on.

        Args:
            index: of the new instant.
            turns: index of the earlier instant, and the turn since then.
        """
        graph = gtsam.NonlinearFactorGraph()
        for since, turn in turns:
            row = self._body.segment_index[turn.segment]
            measured = gtsam.Pose3(gtsam.Rot3(turn.previous_R_segment), np.zeros(3))
            noise = gtsam.noiseModel.Diagonal.Sigmas(np.repeat([turn.sigma, _NO_OPINION_M], 3))
            graph.add(gtsam.BetweenFactorPose3(self.key(since, row), self.key(index, row), measured, noise))
        return graph

    def joints(
        self, index: int, predicted: NDArray[np.float64], expected: ExpectedJoints
    ) -> gtsam.NonlinearFactorGraph:
        """The skeleton (A eq. 3-5) around predicted poses (S, 4, 4): tight where joints hold, loose where they turn.

        A joint that no camera sees is drawn towards the rotation that is expected of it.
        """
        graph = gtsam.NonlinearFactorGraph()
        unseen = set(expected.rows.tolist())
        ends = self._joint_poses.ends.tolist()
        parent_T_child = self._joint_poses.closed(predicted)
        for (parent, child), pose, tree_row, (tight, soft), coupled in zip(
            ends, parent_T_child, self._tree_rows, self._joint_noises, self._coupled, strict=True
        ):
            if coupled:
                continue
            noise = soft if tree_row in unseen else tight
            graph.add(_between(self.key(index, parent), self.key(index, child), pose, noise))
        for row, rotation, sigmas in zip(expected.rows, expected.rotations, expected.sigmas, strict=True):
            joint = self._body.tree_joints[row]
            parent, child = self._body.segment_index[joint.parent], self._body.segment_index[joint.child]
            measured = joint.parent_T_joint @ rigid(rotation, np.zeros(3)) @ joint.joint_T_child
            noise = gtsam.noiseModel.Diagonal.Sigmas(np.concatenate([sigmas, np.full(3, _NO_OPINION_M)]))
            graph.add(_between(self.key(index, parent), self.key(index, child), measured, noise))
        return graph

    def equipment(
        self, index: int, predicted: NDArray[np.float64], joints: Iterable[HeldJoint]
    ) -> gtsam.NonlinearFactorGraph:
        """What couples the body to its equipment (B eq. 15-19) around predicted poses (S, 4, 4): joints like any other.

        An attachment that cameras contradict gives way.
        """
        graph = gtsam.NonlinearFactorGraph()
        for held in joints:
            parent, child = (self._body.segment_index[name] for name in (held.joint.parent, held.joint.child))
            closed = held.joint.measured_relative_pose(inverse(predicted[parent]) @ predicted[child])
            noise = gtsam.noiseModel.Gaussian.Information(held.information)
            if held.kernel is not None:
                kernel = gtsam.noiseModel.mEstimator.Cauchy.Create(held.kernel)
                noise = gtsam.noiseModel.Robust.Create(kernel, noise)
            graph.add(_between(self.key(index, parent), self.key(index, child), closed, noise))
        return graph

    def anchor(
        self, index: int, poses: Mapping[int, NDArray[np.float64]], sigmas: NDArray[np.float64]
    ) -> gtsam.NonlinearFactorGraph:
        """What segments have in place of a past: row -> pose (4, 4), and sigmas (6) of all [rad], [m]."""
        graph = gtsam.NonlinearFactorGraph()
        noise = gtsam.noiseModel.Diagonal.Sigmas(sigmas)
        for row, pose in poses.items():
            graph.add(gtsam.PriorFactorPose3(self.key(index, row), gtsam.Pose3(pose), noise))
        return graph

    def motion(
        self, index: int, steps: NDArray[np.float64], sigmas: NDArray[np.float64], rows: Iterable[int]
    ) -> gtsam.NonlinearFactorGraph:
        """E_O and E_A of A eq. 10-11, on velocities.

        Args:
            index: of the new instant.
            steps: (S, 4, 4) from the instant before that keep the velocity.
            sigmas: (S, 6) of the deviation from them [rad], [m].
            rows: of the segments that go on so.
        """
        graph = gtsam.NonlinearFactorGraph()
        for row in rows:
            noise = gtsam.noiseModel.Diagonal.Sigmas(sigmas[row])
            graph.add(_between(self.key(index - 1, row), self.key(index, row), steps[row], noise))
        return graph


def _between(a: int, b: int, a_T_b: NDArray[np.float64], noise: gtsam.noiseModel.Base) -> gtsam.BetweenFactorPose3:
    return gtsam.BetweenFactorPose3(a, b, gtsam.Pose3(a_T_b), noise)


def _noise(joint: Joint, least_m: float) -> gtsam.noiseModel.Base:
    """The joint's noise, its place no tighter than ``least_m``."""
    sigmas = np.array(joint.sigmas, dtype=np.float64)
    softened = np.concatenate([sigmas[:3], np.maximum(sigmas[3:], least_m)])
    A = (sigmas / softened)[:, None] * joint.square_root_information
    return gtsam.noiseModel.Gaussian.Information(A.T @ A)


def merged(graphs: Mapping[str, gtsam.NonlinearFactorGraph]) -> gtsam.NonlinearFactorGraph:
    """All factors of named graphs in one."""
    together = gtsam.NonlinearFactorGraph()
    for graph in graphs.values():
        together.push_back(graph)
    return together
