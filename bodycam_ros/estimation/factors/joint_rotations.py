"""Expected rotations of unobserved joints, and joints that slide against a spring."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.estimation.coordinates import Coordinates
from bodycam_ros.estimation.factors.stacked import Stacked
from bodycam_ros.geometry import Array, log_jacobian, log_se3, log_so3
from bodycam_ros.geometry_kernels import log_se3_jacobian
from bodycam_ros.kinematics.joint import LOOSE_M, TIGHT_M
from bodycam_ros.kinematics.tangent import TreeTangent

SLIDES_M = 10.1 * TIGHT_M
"""A joint does not slide along axes whose sigmas are smaller [m]."""


@dataclass(frozen=True, eq=False)
class JointRotations(Stacked):
    """Expected rotations of U unobserved joints.

    Attributes:
        joints: (U) rows in ``tree_joints``.
        rotations: (U, 3, 3) joint rotations.
        sigmas: (U, 3) about the child's axes [rad].
    """

    joints: NDArray[np.int64]
    rotations: Array
    sigmas: Array

    @staticmethod
    def nothing() -> "JointRotations":
        """No predicted joint rotations."""
        return JointRotations(np.zeros(0, np.int64), np.zeros((0, 3, 3)), np.zeros((0, 3)))

    def replaced(self, others: "JointRotations") -> "JointRotations":
        """The others, and those of joints that are not among them."""
        return self[~np.isin(self.joints, others.joints)] + others


class ExpectedJoints:
    """The rotation of each joint from where it is expected: log(at^T expected) in sigmas.

    Args:
        tangent: the body's coordinates.
        expected: rotations of joints.
    """

    def __init__(self, tangent: TreeTangent, expected: JointRotations) -> None:
        self._tangent, self._expected = tangent, expected
        self.rows = 3 * len(expected.joints)
        child_R_joint = [tangent.tree.tree_joints[row].child_T_joint[:3, :3] for row in expected.joints]
        self._whitened = np.array(child_R_joint).reshape(-1, 3, 3) / expected.sigmas[..., None]

    def error(self, at: Coordinates) -> Array:
        """See ``StateFactor``."""
        return -(self._whitened @ self._off(at)[..., None]).ravel()

    def linearise(self, at: Coordinates) -> tuple[Array, Array]:
        """See ``StateFactor``."""
        off, jacobian = self._off(at), np.zeros((len(self._whitened), 3, self._tangent.count))
        by_turn = self._whitened @ log_jacobian(off)
        for number, row in enumerate(self._expected.joints.tolist()):
            jacobian[number][:, self._tangent.columns[row]] = by_turn[number] @ self._tangent.twists[row][:3]
        return -(self._whitened @ off[..., None]).ravel(), jacobian.reshape(-1, self._tangent.count)

    def _off(self, at: Coordinates) -> Array:
        """(U, 3) rotation vectors."""
        R = at.joints[self._expected.joints, :3, :3]
        return log_so3(np.swapaxes(R, 1, 2) @ self._expected.rotations)


class SoftSlides:
    """Joints that slide along axes with a finite sigma, from where they are at rest.

    Args:
        tangent: the body's coordinates.
    """

    def __init__(self, tangent: TreeTangent) -> None:
        self._tangent = tangent
        self._soft: list[tuple[int, NDArray[np.intp], Array]] = []
        for row, joint in enumerate(tangent.tree.tree_joints):
            sigmas = np.array(joint.sigmas)[list(joint.free_rows(SLIDES_M))]
            soft = np.flatnonzero(~tangent.turns[tangent.columns[row]] & (sigmas < LOOSE_M))
            if len(soft):
                self._soft.append((row, soft, sigmas[soft]))
        self.rows = sum(len(soft) for _, soft, _ in self._soft)

    def error(self, at: Coordinates) -> Array:
        """See ``StateFactor``."""
        return self.linearise(at)[0]

    def linearise(self, at: Coordinates) -> tuple[Array, Array]:
        """See ``StateFactor``."""
        errors = np.empty(self.rows)
        jacobian = np.zeros((self.rows, self._tangent.count))
        end = 0
        for row, soft, sigmas in self._soft:
            part = slice(end, end := end + len(soft))
            twists, xi = self._tangent.twists[row], log_se3(at.joints[row])
            along = twists[:, soft].T / sigmas[:, None]
            errors[part] = along @ xi
            jacobian[part, self._tangent.columns[row]] = along @ log_se3_jacobian(-xi) @ twists
        return errors, jacobian
