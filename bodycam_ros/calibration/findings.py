"""All that the steps of a calibration found, for those who judge it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.articulation import ArticulatedMotion
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.camera_motion import CameraMotion
from bodycam_ros.calibration.image_evidence import ImageEvidence
from bodycam_ros.calibration.joint_search import FoundJoints
from bodycam_ros.calibration.refinement import Refined
from bodycam_ros.calibration.rest_pose import ZeroedMotion
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.camera.readout import Readout

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Findings:
    """All that the steps of a calibration found; see ``BodyCalibrator``.

    Attributes:
        rig: names.
        delays_before_s: camera -> by how much its clock was taken to be ahead when the motion was found [s].
        found: joints by A eq. 14, virtual cameras and slips.
        motion: of the cameras.
        rows: (N) instants of it that the refinement used.
        images: their landmarks.
        first: the motion of the body before refinement, at those instants.
        refined: after it, in the same frames.
        zeroed: the refined motion with the N-pose as zero, its heading and the hinges' axes.
        straight_sigma: how straight a limb stands in the N-pose [m].
        rest_s: (from, to) [s] of the N-pose.
        image_counts: camera -> images seen, registered.
        readouts: camera -> how long its rows are read out.
        doubts: camera -> what is not known of that, and what it may cost, of those that are doubtful.
    """

    rig: Rig
    delays_before_s: Mapping[str, float]
    found: FoundJoints
    motion: CameraMotion
    rows: NDArray[np.intp]
    images: ImageEvidence
    first: ArticulatedMotion
    refined: Refined
    zeroed: ZeroedMotion
    straight_sigma: float
    rest_s: tuple[float, float]
    image_counts: Mapping[str, tuple[int, int]]
    readouts: Mapping[str, Readout]
    doubts: Mapping[str, str]

    @property
    def delays_s(self) -> dict[str, float]:
        """Camera -> by how much its clock is ahead of the reference's [s]; see ``CameraDiagnosis.clock_s``."""
        motion = self.refined.motion
        return {
            camera: self.delays_before_s[camera] + float(delay)
            for camera, delay in zip(motion.cameras, motion.delays, strict=True)
        }

    @property
    def body(self) -> BodyModel:
        """The body of ``zeroed``."""
        return self.zeroed.motion.body

    @property
    def hinges(self) -> Mapping[str, Array]:
        """Child segment -> (3,) axis of those joints that turned as hinges, in N-pose axes."""
        return self.zeroed.hinges

    def offset_covariance(self) -> Array:
        """Covariance (3 S, 3 S) of the joints' places in their parents, in N-pose axes [m^2].

        Along a hinge's axis the motion tells nothing, so that leaving some of it out changes nothing; there the
        straightness of the limb is all that is known.
        """
        refined, zeroed = self.refined.motion, self.zeroed.motion
        count = 3 * len(self.body.segments)
        zero_R_refined = np.zeros((count, count))
        covariance_along = np.zeros((count, count))
        for row, parent in enumerate(zeroed.parent_rows):
            columns = zeroed.offset_columns(row)
            parent = max(parent, 0)
            zero_R_refined[columns, columns] = zeroed.rotations[0, parent].T @ refined.rotations[0, parent]
            axis = self.hinges.get(self.body.segments[row])
            if axis is not None:
                covariance_along[columns, columns] = self.straight_sigma**2 * np.outer(axis, axis)
        in_motion = zero_R_refined @ self.refined.covariance[:count, :count] @ zero_R_refined.T
        return in_motion + covariance_along
