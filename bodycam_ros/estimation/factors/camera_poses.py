"""Poses of segments by their cameras (A eq. 8, first term): each camera's hundred measurements as one pose."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.coordinates import Coordinates
from bodycam_ros.estimation.factors.camera_kernels import camera_equations, camera_errors, camera_rows
from bodycam_ros.estimation.factors.stacked import Stacked
from bodycam_ros.geometry import Array

KERNEL = 8.0  # sigmas from which on a measurement counts less (Cauchy): a wrong one must not bend the limb


@dataclass(frozen=True, eq=False)
class SegmentPoses(Stacked):
    """Poses of segments by N cameras: the logarithm of each from the body's, with Cauchy's loss.

    Attributes:
        segments: (N) rows of the segments.
        world_T_segment: (N, 4, 4) [m].
        covariances: (N, 6, 6) in the segments' axes, rotation [rad] then translation [m].
    """

    segments: NDArray[np.int64]
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
        return len(self.segments)

    @property
    def rows(self) -> int:
        """See ``StateFactor``."""
        return 6 * len(self)

    @cached_property
    def information(self) -> Array:
        """(N, 6, 6) inverse covariances."""
        return np.asarray(np.linalg.inv(self.covariances), np.float64)

    @cached_property
    def _root(self) -> Array:
        """(N, 6, 6) upper triangular square roots of the information."""
        information = 0.5 * (self.information + np.swapaxes(self.information, 1, 2))
        return np.ascontiguousarray(np.swapaxes(np.linalg.cholesky(information), 1, 2))

    def error(self, at: Coordinates) -> Array:
        """See ``StateFactor``."""
        errors: Array = camera_errors(at.poses, self.segments, self.world_T_segment, self._root, KERNEL)
        return errors

    def linearise(self, at: Coordinates) -> tuple[Array, Array]:
        """See ``StateFactor``."""
        linear: tuple[Array, Array] = camera_rows(
            at.poses, at.jacobians, self.segments, self.world_T_segment, self._root, KERNEL
        )
        return linear

    def equations(self, at: Coordinates) -> tuple[Array, Array, Array, Array]:
        """Normal equations about coordinates without weights, residuals and Jacobians: as ``camera_equations``."""
        equations: tuple[Array, Array, Array, Array] = camera_equations(
            at.poses, at.jacobians, self.segments, self.world_T_segment, self.information
        )
        return equations
