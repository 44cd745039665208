"""The measurements of one state, and the state that fits them best: iterated, robust, with covariance.

Every measurement is linearised in the increments (K) of the body's coordinates: poses of segments by their cameras (A
eq. 8, first term), expected rotations of unobserved joints, gaps of joints that close loops (B eq. 15). The prediction
is one more of them. Gauss-Newton with Cauchy's weights finds the mode; the inverse of its matrix is the covariance.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.camera_kernels import camera_equations
from bodycam_ros.estimation.estimate import LINEAR, SETTLED, STEPS, Coordinates, Transition
from bodycam_ros.geometry import Array, adjoint, inverse, log_jacobian, log_se3, log_so3
from bodycam_ros.kinematics.joint import LOOSE_M, TIGHT_M
from bodycam_ros.kinematics.tangent import LoopGaps, TreeTangent
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.settings import setting

KERNEL = 8.0  # sigmas from which on a measurement counts less (Cauchy): a wrong one must not bend the limb
SLIDES_M = 10.1 * TIGHT_M  # a joint does not slide along axes whose sigmas are smaller


@dataclass(frozen=True, eq=False)
class _Stacked:
    """Arrays with a row for each measurement."""

    def __add__(self, other: Self) -> Self:
        """The rows of both."""
        names = [each.name for each in fields(self)]
        return type(self)(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))

    def __getitem__(self, rows: NDArray[Any]) -> Self:
        """Some of the rows, by number or mask."""
        return type(self)(*(getattr(self, each.name)[rows] for each in fields(self)))


@dataclass(frozen=True, eq=False)
class SegmentPoses(_Stacked):
    """Poses of segments by N cameras.

    Attributes:
        rows: (N) of the segments.
        world_T_segment: (N, 4, 4) [m].
        covariances: (N, 6, 6) in the segments' axes, rotation [rad] then translation [m].
    """

    rows: NDArray[np.int64]
    world_T_segment: Array
    covariances: Array

    @staticmethod
    def from_evidence(body: BodyModel, evidence: Iterable[SegmentPose]) -> "SegmentPoses":
        """Stacked measurements."""
        poses = list(evidence)
        return SegmentPoses(
            np.array([body.segment_index[each.segment] for each in poses], np.int64),
            np.array([each.world_T_segment for each in poses]).reshape(-1, 4, 4),
            np.array([each.covariance for each in poses]).reshape(-1, 6, 6),
        )

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def information(self) -> Array:
        """(N, 6, 6) inverse covariances."""
        return np.asarray(np.linalg.inv(self.covariances), np.float64)

    def equations(self, at: Coordinates, sigmas: float = np.inf) -> tuple[Array, Array, Array, Array]:
        """Normal equations about coordinates, residuals and Jacobians: as ``camera_equations``."""
        equations: tuple[Array, Array, Array, Array] = camera_equations(
            at.poses, at.jacobians, self.rows, self.world_T_segment, self.information, sigmas
        )
        return equations


@dataclass(frozen=True, eq=False)
class JointRotations(_Stacked):
    """Expected rotations of U unobserved joints.

    Attributes:
        rows: (U) of the joints in ``tree_joints``.
        rotations: (U, 3, 3) joint rotations.
        sigmas: (U, 3) about the child's axes [rad].
    """

    rows: NDArray[np.int64]
    rotations: Array
    sigmas: Array

    @staticmethod
    def nothing() -> "JointRotations":
        """Of no joint."""
        return JointRotations(np.zeros(0, np.int64), np.zeros((0, 3, 3)), np.zeros((0, 3)))

    def replaced(self, others: "JointRotations") -> "JointRotations":
        """The others, and those of joints that are not among them."""
        return self[~np.isin(self.rows, others.rows)] + others


@dataclass(frozen=True, eq=False)
class Measurements:
    """All measurements of one state.

    Attributes:
        cameras: poses of segments.
        expected: rotations of unobserved joints.
        closed: attachment that closes a loop now -> sigmas from which on it counts less.
    """

    cameras: SegmentPoses
    expected: JointRotations
    closed: Mapping[str, float] = field(default_factory=dict)


class StateFit:
    """Fits the coordinates of one state.

    Args:
        tangent: the body's coordinates.
        attachments: names of loops that are closed at times; the others always are.
    """

    def __init__(self, tangent: TreeTangent, attachments: Collection[str] = ()) -> None:
        self._tangent = tangent
        joints = tangent.tree.tree_joints
        loops = tangent.tree.loop_joints
        self._loops = LoopGaps(tangent.tree, loops)
        self._kernels = {joint.name: 0.0 if joint.name in attachments else np.inf for joint in loops}
        self._child_R_joint = np.array([joint.child_T_joint[:3, :3] for joint in joints]).reshape(-1, 3, 3)
        # Axes along which joints slide, with a finite sigma.
        self._soft = {}
        for row, joint in enumerate(joints):
            sigmas = np.array(joint.sigmas)[list(joint.free_rows(SLIDES_M))]
            sigmas = np.where(tangent.turns[tangent.columns[row]] | (sigmas >= LOOSE_M), np.inf, sigmas)
            if np.isfinite(sigmas).any():
                self._soft[row] = sigmas

    def fit(self, link: Transition, measured: Measurements, start: Coordinates) -> Transition:
        """Both states of a transition given measurements of the later one.

        Args:
            link: without them.
            measured: of the later state.
            start: its initial coordinates.
        """
        K, predicted, at, robust = self._tangent.count, link.after, start, False
        prior = predicted.information
        for _ in range(STEPS):
            A, b = self._normal_equations(at, measured, robust)
            information = prior + A
            x = predicted.at.step_to(at)[:K]
            step = np.asarray(np.linalg.solve(information, b - prior @ x), np.float64)
            at = at.moved(step)
            moved = float(np.abs(step).max())
            if robust and moved < SETTLED:
                break
            robust = robust or moved < LINEAR
        covariance = np.linalg.inv(information)
        return link.fitted(at, 0.5 * (covariance + covariance.T), x + step)

    def _normal_equations(self, at: Coordinates, measured: Measurements, robust: bool) -> tuple[Array, Array]:
        """Matrix (K, K) and right side (K) of all measurements about coordinates."""
        K = self._tangent.count
        A, b, _, _ = measured.cameras.equations(at, KERNEL if robust else np.inf)
        expected = measured.expected
        for row, rotation, sigmas in zip(expected.rows.tolist(), expected.rotations, expected.sigmas, strict=True):
            columns, turns = self._tangent.columns[row], self._tangent.twists[row][:3]
            W = self._child_R_joint[row] / sigmas[:, None]
            r = log_so3(at.joints[row, :3, :3].T @ rotation)
            J, r = W @ log_jacobian(r) @ turns, W @ r
            A[columns, columns] += J.T @ J
            b[columns] += J.T @ r
        for row, sigmas in self._soft.items():
            columns, twists = self._tangent.columns[row], self._tangent.twists[row]
            A[columns, columns] += np.diag(sigmas**-2.0)
            b[columns] -= twists.T @ log_se3(at.joints[row]) / sigmas**2
        kernels = np.array([*{**self._kernels, **measured.closed}.values()])
        if kernels.any():
            gaps, J = self._loops.linearised(at.poses, at.jacobians)
            r, J = gaps / self._loops.sigmas, J / self._loops.sigmas[..., None]
            # With a kernel of zero a loop is open, even where it has no gap; an infinite one never counts less.
            weights, finite = np.isinf(kernels).astype(np.float64), (kernels > 0.0) & (kernels < np.inf)
            squared = kernels[finite] ** 2
            weights[finite] = squared / (squared + (r[finite] ** 2).sum(axis=1))
            of_rows = (weights[:, None, None] * J).reshape(-1, K)
            A += of_rows.T @ J.reshape(-1, K)
            b -= of_rows.T @ r.ravel()
        return A, b


@dataclass(frozen=True)
class EvidenceSettings:
    """Accuracy of body cameras."""

    mount_rotation_sigma: float = setting(
        0.0004,
        unit="rad",
        limits=(0.0, 0.1),
        reason="least sigma of a registration's rotation: errors that map, lens and strap share, at any count",
    )
    mount_translation_sigma: float = setting(0.001, unit="m", limits=(0.0, 0.1), reason="the same for its position")


def evidence_floor(settings: EvidenceSettings) -> NDArray[np.float64]:
    """Covariance (6, 6) that is added to every registration: map, lens and strap err together."""
    return np.diag(np.repeat([settings.mount_rotation_sigma, settings.mount_translation_sigma], 3) ** 2)


class MountedCameras:
    """Poses of segments by registered cameras, all of a frame at once.

    Args:
        body: whose mounts are used.
        settings: accuracy of cameras.
    """

    def __init__(self, body: BodyModel, settings: EvidenceSettings) -> None:
        self._mounts = body.mounts
        self._floor = evidence_floor(settings)
        self._row = {camera: row for row, camera in enumerate(body.mounts)}
        segment_T_camera = np.array([mount.segment_T_camera for mount in body.mounts.values()]).reshape(-1, 4, 4)
        self._camera_T_segment = inverse(segment_T_camera)
        self._segment_xi_camera = adjoint(segment_T_camera)

    def absolute_evidence(self, matches: Iterable[LandmarkMatches]) -> dict[str, SegmentPose]:
        """Camera -> measured pose of its segment, of registered cameras on the body."""
        registered = [m for m in matches if m.world_T_camera is not None and m.camera in self._row]
        if not registered:
            return {}
        rows = [self._row[each.camera] for each in registered]
        world_T_segment = np.array([each.world_T_camera for each in registered]) @ self._camera_T_segment[rows]
        Ad = self._segment_xi_camera[rows]
        covariances = np.array([each.pose_covariance for each in registered]) + self._floor
        on_segment = Ad @ covariances @ np.swapaxes(Ad, -1, -2)
        return {
            each.camera: SegmentPose(self._mounts[each.camera].segment, pose, covariance)
            for each, pose, covariance in zip(registered, world_T_segment, on_segment, strict=True)
        }
