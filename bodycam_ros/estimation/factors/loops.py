"""Joints that close loops: equipment on a body (B eq. 15), as gaps of joints in six sigmas."""

from collections.abc import Collection, Mapping

import numpy as np

from bodycam_ros.estimation.coordinates import Coordinates
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import LoopGaps
from bodycam_ros.kinematics.tree import KinematicTree


class ClosedLoops:
    """Gaps of the closed ones of L joints, each with Cauchy's loss where it has a kernel.

    Args:
        gaps: of all joints that close loops.
        kernels: (L) sigmas from which on a gap counts less; zero: the loop is open; infinity: it never counts less.
    """

    def __init__(self, gaps: LoopGaps, kernels: Array) -> None:
        self._gaps, self._closed = gaps, np.flatnonzero(kernels > 0.0)
        self._squared = kernels[self._closed] ** 2
        self.rows = 6 * len(self._closed)

    def error(self, at: Coordinates) -> Array:
        """See ``StateFactor``."""
        e = self._gaps.jacobians(at.poses)[0][self._closed] / self._gaps.sigmas[self._closed]
        far = (e**2).sum(axis=1) / self._squared
        losses = np.where(far > 0.0, np.log1p(far) / np.where(far > 0.0, far, 1.0), 1.0)
        return np.asarray(np.sqrt(losses)[:, None] * e, np.float64).ravel()

    def linearise(self, at: Coordinates) -> tuple[Array, Array]:
        """See ``StateFactor``."""
        gaps, J = self._gaps.linearised(at.poses, at.jacobians)
        sigmas = self._gaps.sigmas[self._closed]
        e, J = gaps[self._closed] / sigmas, J[self._closed] / sigmas[..., None]
        weights = np.sqrt(1.0 / (1.0 + (e**2).sum(axis=1) / self._squared))
        return (weights[:, None] * e).ravel(), (weights[:, None, None] * J).reshape(self.rows, at.tangent.count)


class Loops:
    """All joints of a tree that close loops.

    Args:
        tree: segments and joints.
        attachments: names of loops that are closed at times; the others always are.
    """

    def __init__(self, tree: KinematicTree, attachments: Collection[str] = ()) -> None:
        self._gaps = LoopGaps(tree, tree.loop_joints)
        self._kernels = {joint.name: 0.0 if joint.name in attachments else np.inf for joint in tree.loop_joints}

    def closed(self, active: Mapping[str, float]) -> ClosedLoops:
        """The loops of one state, with the active attachments and the sigmas from which on each counts less."""
        return ClosedLoops(self._gaps, np.array([*{**self._kernels, **active}.values()]))
