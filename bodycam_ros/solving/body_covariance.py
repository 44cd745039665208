"""How well the body is known at an instant: a covariance for the root, its velocity, and every joint.

The smoother's own marginals cost as much as its solution, take the errors of registrations for white noise, and know
no velocity, so that they grow too slowly while nothing is seen. Here each segment has a pose and a velocity whose
covariance is carried from instant to instant (a constant-velocity Kalman filter), and all segments of one instant are
joined by what cameras and joints say, in one information matrix of the whole body.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import adjoint, inverse
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.settings import setting
from bodycam_ros.solving.camera_evidence import SegmentPose, SegmentTurn
from bodycam_ros.solving.expected_joints import ExpectedJoints
from bodycam_ros.solving.held_joint import HeldJoint
from bodycam_ros.solving.motion import MotionSettings

_VAGUE = np.repeat([1.0, 1.0], 3)  # [rad], [m] a body that begins: known by its cameras alone
_VELOCITY_SIGMA = np.repeat([6.0, 2.0], 3)  # [rad/s], [m/s] of people's segments, before anything is known of it
_STIFFEST = np.repeat([2e-4, 1e-3], 3)  # [rad], [m] joints as tight as the smoother's would leave no digits


@dataclass(frozen=True)
class CovarianceSettings:
    """What a registration's own covariance does not know."""

    root_rotation_sigma: float = setting(
        0.0002,
        unit="rad",
        limits=(0.0, 0.1),
        reason="error of the calibrated body itself, the same at all instants",
    )
    root_translation_sigma: float = setting(0.0006, unit="m", limits=(0.0, 0.1), reason="the same for positions")
    correlation_time: float = setting(
        0.3,
        unit="s",
        limits=(0.001, 10.0),
        reason="errors of registrations fade so slowly (0.9 from image to image at 30 Hz), so differences err far less",
    )
    acceleration_time: float = setting(
        0.033,
        unit="s",
        limits=(0.001, 1.0),
        reason="how long an acceleration of motion.acceleration_sigma lasts; with it grows what is not seen",
    )


@dataclass(frozen=True)
class BodyUncertainty:
    """Covariances at one instant; rotation [rad] first, then translation [m], in the axes of what they speak of.

    Attributes:
        root: (6, 6) of the root segment's pose.
        root_twist: (6, 6) of its velocity [rad/s, m/s].
        joints: (J, 3, 3) of the joint rotations, in the child segment's axes [rad^2].
        segments: (S, 6, 6) of the segments' poses.
    """

    root: NDArray[np.float64]
    root_twist: NDArray[np.float64]
    joints: NDArray[np.float64]
    segments: NDArray[np.float64]


class BodyCovariance:
    """Carries the covariances of all segments along.

    Args:
        body: segments and joints.
        motion: how suddenly segments change their motion.
        settings: what else is uncertain.
        coupled: names of joints that hold at some instants, and are told then.
    """

    def __init__(
        self,
        body: BodyModel,
        motion: MotionSettings,
        settings: CovarianceSettings,
        coupled: Collection[str] = frozenset[str](),
    ) -> None:
        self._body = body
        self._motion = motion
        self._settings = settings
        self._root = body.segment_index[body.root]
        # The joints of the tree first, in its order, then those that close loops.
        joints = (*body.tree_joints, *body.loop_joints)
        self._tree = len(body.tree_joints)
        self._joint_parents = np.array([body.segment_index[joint.parent] for joint in joints], int)
        self._joint_children = np.array([body.segment_index[joint.child] for joint in joints], int)
        holds = np.array([joint.name not in coupled for joint in joints], float)
        own = np.array([_softened_information(joint) for joint in joints]).reshape(-1, 6, 6)
        self._joint_information = holds[:, None, None] * own
        count = len(body.segments)
        # Which joints (J) add to which segment, and to which of the pairs (P) of segments that joints tie together.
        each = np.arange(count)[:, None]
        self._of_child = (each == self._joint_children).astype(np.float64)
        self._of_parent = (each == self._joint_parents).astype(np.float64)
        ends = np.stack([self._joint_children, self._joint_parents], axis=1).reshape(-1, 2)
        self._pairs, pair_of = np.unique(ends, axis=0, return_inverse=True)
        self._of_pair = (np.arange(len(self._pairs))[:, None] == pair_of.reshape(-1)).astype(np.float64)
        self._pose = np.tile(np.diag(_VAGUE**2), (count, 1, 1))
        self._velocity = np.tile(np.diag(_VELOCITY_SIGMA**2), (count, 1, 1))
        self._cross = np.zeros((count, 6, 6))  # velocity with pose

    def update(
        self,
        dt_s: float,
        world_T_segment: NDArray[np.float64],
        evidence: Collection[SegmentPose],
        turns: Iterable[SegmentTurn],
        expected: ExpectedJoints,
        held: Iterable[HeldJoint] = (),
    ) -> BodyUncertainty:
        """Go on by ``dt_s`` to an instant of poses (S, 4, 4), of what was seen at it, and of what held the body."""
        self._carry_on(dt_s, turns)
        prior = self._pose
        count = len(prior)
        held = list(held)
        # Where they are, segments that are tied know from each other: together no better than each of them.
        own = np.ones((count, 6))
        own[:, 3:] = 1.0 / np.sqrt(self._tied(held))[:, None]
        prior_information = np.linalg.inv(prior)
        rows = [self._body.segment_index[seen.segment] for seen in evidence]
        of_cameras = np.linalg.inv(np.array([seen.covariance for seen in evidence]).reshape(-1, 6, 6))
        of_segment = (np.arange(count)[:, None] == np.array(rows, int)).astype(np.float64)
        of_joints, crossed = self._joint_terms(world_T_segment, expected)
        information = np.zeros((count, 6, count, 6))
        each = np.arange(count)
        information[each, :, each, :] = (
            own[:, :, None] * prior_information * own[:, None, :] + _summed(of_segment, of_cameras) + of_joints
        )
        children, parents = self._pairs.T
        information[children, :, parents, :] += crossed
        information[parents, :, children, :] += np.swapaxes(crossed, -1, -2)
        self._hold(information, world_T_segment, held)
        full = information.reshape(6 * count, 6 * count)
        covariance = np.asarray(np.linalg.inv(0.5 * (full + full.T)), np.float64).reshape(count, 6, count, 6)
        self._condition(prior, prior_information, covariance[each, :, each, :])
        return self._uncertainty(world_T_segment, covariance, dt_s, self._root in rows)

    def _carry_on(self, dt_s: float, turns: Iterable[SegmentTurn]) -> None:
        """Prediction of a filter at constant, slowly fading velocity; a measured turn bounds the rotation."""
        fade_s = self._motion.velocity_time
        keep = np.exp(-dt_s / fade_s)
        reach_s = fade_s * (1.0 - keep)
        Q = np.diag(self.density)
        before = self._pose
        self._pose = (
            before + reach_s * (self._cross + np.swapaxes(self._cross, -1, -2)) + reach_s**2 * self._velocity
        ) + dt_s**3 / 3.0 * Q
        self._cross = keep * (self._cross + reach_s * self._velocity) + dt_s**2 / 2.0 * Q
        self._velocity = keep**2 * self._velocity + dt_s * Q
        for turn in turns:
            row = self._body.segment_index[turn.segment]
            known = np.zeros((6, 6))
            known[:3, :3] = before[row, :3, :3] + turn.sigma**2 * np.eye(3)
            known[3:, 3:] = self._pose[row, 3:, 3:]
            self._pose[row], self._cross[row] = known, 0.0

    @property
    def density(self) -> NDArray[np.float64]:
        """Spectral density (6) of the accelerations, rotation then translation."""
        sigmas = [self._motion.angular_acceleration_sigma, self._motion.acceleration_sigma]
        return np.repeat(np.square(sigmas), 3) * self._settings.acceleration_time

    def _joint_terms(
        self, world_T_segment: NDArray[np.float64], expected: ExpectedJoints
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Joints, and what the seen poses say of joints that are not seen.

        Returns:
            Information (S, 6, 6) of each segment, and (P, 6, 6) between children and parents.
        """
        of_child = self._joint_information.copy()
        of_child[expected.rows, :3, :3] += np.eye(3) / np.square(expected.sigmas)[:, None, :]
        p, c = self._joint_parents, self._joint_children
        child_xi_parent = -adjoint(inverse(world_T_segment[c]) @ world_T_segment[p])
        crossed = of_child @ child_xi_parent
        of_parent = np.swapaxes(child_xi_parent, -1, -2) @ crossed
        of_segments = _summed(self._of_child, of_child) + _summed(self._of_parent, of_parent)
        return of_segments, _summed(self._of_pair, crossed)

    def _tied(self, held: Iterable[HeldJoint]) -> NDArray[np.intp]:
        """How many segments (S,) each is tied to by joints that hold, itself among them."""
        ends = self._pairs[self._of_pair @ np.abs(self._joint_information).sum(axis=(1, 2)) > 0.0].tolist()
        for each in held:
            ends.append([self._body.segment_index[name] for name in (each.joint.child, each.joint.parent)])
        part = np.arange(len(self._pose))
        for one, other in ends:
            part[part == part[one]] = part[other]
        return np.asarray(np.bincount(part)[part])

    def _hold(
        self, information: NDArray[np.float64], world_T_segment: NDArray[np.float64], held: Iterable[HeldJoint]
    ) -> None:
        """Add what couples the body to its equipment to the information (S, 6, S, 6), in place."""
        for each in held:
            p, c = (self._body.segment_index[name] for name in (each.joint.parent, each.joint.child))
            child_xi_parent = -adjoint(inverse(world_T_segment[c]) @ world_T_segment[p])
            crossed = each.information @ child_xi_parent
            information[c, :, c] += each.information
            information[p, :, p] += child_xi_parent.T @ crossed
            information[c, :, p] += crossed
            information[p, :, c] += crossed.T

    def _condition(
        self,
        prior: NDArray[np.float64],
        prior_information: NDArray[np.float64],
        posterior: NDArray[np.float64],
    ) -> None:
        """What was learned of the poses tells of the velocities, too."""
        gain = self._cross @ prior_information
        self._velocity = self._velocity - gain @ (prior - posterior) @ np.swapaxes(gain, -1, -2)
        self._cross = gain @ posterior
        self._pose = posterior.copy()

    def _uncertainty(
        self, world_T_segment: NDArray[np.float64], covariance: NDArray[np.float64], dt_s: float, seen: bool
    ) -> BodyUncertainty:
        body_error = np.repeat([self._settings.root_rotation_sigma, self._settings.root_translation_sigma], 3) ** 2
        p, c = self._joint_parents[: self._tree], self._joint_children[: self._tree]
        child_R_parent = np.swapaxes(world_T_segment[c, :3, :3], -1, -2) @ world_T_segment[p, :3, :3]
        parent_R_child = np.swapaxes(child_R_parent, -1, -2)
        crossed = child_R_parent @ covariance[p, :3, c, :3]
        joints = (
            covariance[c, :3, c, :3]
            + child_R_parent @ covariance[p, :3, p, :3] @ parent_R_child
            - crossed
            - np.swapaxes(crossed, -1, -2)
        )
        each = np.arange(len(covariance))
        segments = covariance[each, :, each, :]
        known = segments + np.diag(body_error)
        return BodyUncertainty(known[self._root], self._twist(segments[self._root], dt_s, seen), joints, known)

    def _twist(self, root: NDArray[np.float64], dt_s: float, seen: bool) -> NDArray[np.float64]:
        """Covariance (6, 6) of the root's velocity: a difference of two poses whose errors are nearly the same.

        Unseen, it is the filter's, which knows how people speed up.
        """
        if not seen or dt_s == 0.0:
            return np.array(self._velocity[self._root])
        changed = 1.0 - np.exp(-dt_s / self._settings.correlation_time)
        return np.asarray(2.0 * changed / dt_s**2 * root)


def _summed(which: NDArray[np.float64], matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums (N, 6, 6) of those of the matrices (M, 6, 6) that belong (N, M) to each."""
    return np.asarray((which @ matrices.reshape(-1, 36)).reshape(-1, 6, 6))


def _softened_information(joint: Joint) -> NDArray[np.float64]:
    """Information (6, 6) of a joint's residual in the child's axes, none of it stiffer than the arithmetic bears."""
    sigmas = np.array(joint.sigmas, dtype=np.float64)
    A = (sigmas / np.maximum(sigmas, _STIFFEST))[:, None] * joint.square_root_information
    return np.asarray(A.T @ A)
