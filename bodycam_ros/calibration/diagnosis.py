"""What a calibration found out about itself: figures for the person who must decide whether to trust the body."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.calibration.anthropometry import BoneLength
from bodycam_ros.camera.readout import Readout


@dataclass(frozen=True, eq=False)
class JointDiagnosis:
    """How well one joint is known.

    Attributes:
        name, parent, child: of the joint.
        freedom: what the joint did in the recording, from the singular values of A eq. 14.
        exercised_rad: (3,) extent of its rotation about its own principal axes, largest first [rad].
        gap_m: median distance between the joint on the parent and on the child, over time [m].
        sigma_m: (3,) standard deviation of its place in the parent, in the N-pose's axes [m].
        advice: what the user should repeat or look at; empty when nothing.
    """

    name: str
    parent: str
    child: str
    freedom: Literal["ball", "hinge"]
    exercised_rad: NDArray[np.float64]
    gap_m: float
    sigma_m: NDArray[np.float64]
    advice: str = ""


@dataclass(frozen=True)
class CameraDiagnosis:
    """How a camera sat on its segment.

    Attributes:
        camera, segment: names.
        images: of the recording.
        registered: share of them that were registered, 0 to 1.
        residual_m, residual_rad: median difference between where it was and where the body puts it, after refinement.
        moved_m, turned_rad: largest lasting change of its place on the segment [m], [rad]; 0 when it held still.
        slipped_s: when that change came, seconds after the start; None when it held still.
        readout: how long its rows are read out; None if nothing is known of it.
        warning: for the user; empty when nothing.
        clock_s: by how much its clock is ahead of the reference's [s], the first that shares its stamps if any.
    """

    camera: str
    segment: str
    images: int
    registered: float
    residual_m: float
    residual_rad: float
    moved_m: float
    turned_rad: float
    slipped_s: float | None
    readout: Readout | None = None
    warning: str = ""
    clock_s: float = 0.0


@dataclass(frozen=True)
class CalibrationDiagnosis:
    """Diagnosis of a whole calibration.

    Attributes:
        joints, bones, cameras: in the order of the body.
        rest_s: (from, to) seconds after the start in which the N-pose was held.
        heading_rad: direction that the person faced in the N-pose, about the map's z from its x [rad].
        duration_s: of the recording.
        stature_m: height that the bones together let expect [m]; None when too few of them are known.
        scale_warning: why the scale of the map is in doubt; empty when it is not.
    """

    joints: tuple[JointDiagnosis, ...]
    bones: tuple[BoneLength, ...]
    cameras: tuple[CameraDiagnosis, ...]
    rest_s: tuple[float, float]
    heading_rad: float
    duration_s: float
    stature_m: float | None
    scale_warning: str = ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Everything that a person should look at: the scale, then in the order of the body."""
        warnings = [self.scale_warning, *(joint.advice for joint in self.joints)]
        warnings += [*(bone.warning for bone in self.bones), *(camera.warning for camera in self.cameras)]
        return tuple(text for text in warnings if text)
