"""The body at one time, as it passes from the estimator to messages, files and pictures."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.registration.landmark_matches import LandmarkMatches

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SegmentPose:
    """An absolute measurement of a segment: world_T_segment (4, 4) and its covariance (6, 6) in segment axes."""

    segment: str
    world_T_segment: NDArray[np.float64]
    covariance: NDArray[np.float64]


@dataclass(frozen=True)
class BodyUncertainty:
    """Covariances at one time; rotation [rad] first, then translation [m], in the axes of what they speak of.

    Attributes:
        root: (6, 6) of the root segment's pose.
        root_twist: (6, 6) of its velocity [rad/s, m/s].
        joints: (J, 3, 3) of the joint rotations, in the child segment's axes [rad^2].
        segments: (S, 6, 6) of the segments' poses.
    """

    root: Array
    root_twist: Array
    joints: Array
    segments: Array


@dataclass(frozen=True)
class BodyState:
    """The pose of every segment at one time.

    Attributes:
        stamp_ns: its time [ns].
        segments: (S) names, in the order of ``BodyModel.segments``.
        world_T_segment: (S, 4, 4) poses [m].
        twists: (S, 6) velocities at the state, angular [rad/s] then linear [m/s], in the segments' axes.
        uncertainty: covariances of root, velocity, joints and segments.
        observed: (S,) whether a camera on the segment was registered and accepted; else the pose follows from its
            joints, from smoothness and from the poses that the body has been seen in.
        cameras_used: how many cameras were registered and accepted.
        converged: whether the fit of the state did; if not, its covariances are widened.
        equipment: how the body is coupled to what it rides, holds or stands on; None without such.
    """

    stamp_ns: int
    segments: tuple[str, ...]
    world_T_segment: NDArray[np.float64]
    twists: NDArray[np.float64]
    uncertainty: BodyUncertainty
    observed: NDArray[np.bool_]
    cameras_used: int
    converged: bool = True
    equipment: EquipmentReport | None = None

    @property
    def predicted(self) -> bool:
        """Whether no camera was accepted, so that the state follows from what came before and after."""
        return self.cameras_used == 0


@dataclass(frozen=True)
class BodyOutput:
    """What is published about one state.

    Attributes:
        state: poses of all segments.
        joint_names: A names, in constant order.
        positions: (A,) joint angles [rad], as of ``JointAngleTracker``.
        velocities: (A,) rates of the joint angles at the state, by the twists of the state [rad/s].
    """

    state: BodyState
    joint_names: tuple[str, ...]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]


@dataclass(frozen=True)
class BodyFrame:
    """The registrations of one frame, and images of static cameras.

    Attributes:
        stamp_ns: its time [ns].
        matches: camera -> its registration; a camera without one is absent.
        images: static camera -> its image.
        is_earlier: whether time went back to it, so that nothing is known of the motion before.
    """

    stamp_ns: int
    matches: Mapping[str, LandmarkMatches]
    images: Mapping[str, CameraImage] = field(default_factory=dict)
    is_earlier: bool = False
