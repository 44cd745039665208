"""What the tracker says about one image."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3, nearest_rotation, rigid

NO_LANDMARK: Final = 0xFFFFFFFF
"""In place of a landmark's id, of a track that the tracker has no name for."""


@dataclass(frozen=True)
class TrackFrame:
    """The feature tracks of one camera at one instant.

    A track keeps its id from birth to end. Descriptors are rare: only a track that needs a name carries
    one, and only in the frame in which it was described.

    Attributes:
        camera: the camera's name, which is its topic prefix.
        stamp_ns: mid-exposure of the middle row [ns].
        previous_stamp_ns: stamp of the frame that ``current_R_previous`` starts from; 0 if there is none.
        track_ids: (N,) uint32.
        pixels: (N, 2) float32, pixel centres at integers.
        described: (M,) uint32, rows of ``track_ids`` that carry a descriptor in this frame, the strongest first.
        descriptors: (M, 128) uint8 RootSIFT.
        scales: (M,) float32, SIFT scale (sigma) of the described tracks [px].
        keyframe: whether new features were looked for in this frame.
        current_R_previous: (3, 3) rotation of the camera between the two frames (A eq. 2).
        rotation_inliers: tracks that agree with that rotation; 0 if it is unknown.
        landmark_ids: (N,) uint32 the landmarks that the tracks were found by; ``NO_LANDMARK`` of the others. None: of
            no track.
    """

    camera: str
    stamp_ns: int
    previous_stamp_ns: int
    track_ids: NDArray[np.uint32]
    pixels: NDArray[np.float32]
    described: NDArray[np.uint32]
    descriptors: NDArray[np.uint8]
    scales: NDArray[np.float32]
    keyframe: bool
    current_R_previous: NDArray[np.float64]
    rotation_inliers: int
    landmark_ids: NDArray[np.uint32] | None = None


LONGEST_NS = 500_000_000
"""Nobody keeps a velocity for longer: from then on a prediction stands still."""


def camera_velocity(world_T_earlier: Array, world_T_camera: Array, passed_ns: int) -> Array:
    """(6,) twist in camera axes [rad/s, m/s] that brings a camera from one pose to another in the time passed [ns]."""
    return np.asarray(log_se3(inverse(world_T_earlier) @ world_T_camera) / (1e-9 * passed_ns))


def predict_pose(world_T_camera: Array, velocity: Array, passed_ns: int, later_R_camera: Array | None = None) -> Array:
    """The pose (4, 4) after some time.

    Args:
        world_T_camera: (4, 4) the pose.
        velocity: (6,) of ``camera_velocity`` [rad/s, m/s].
        passed_ns: how much later [ns].
        later_R_camera: (3, 3) rotation since then where it was measured (A eq. 2).
    """
    camera_T_later = exp_se3(1e-9 * min(passed_ns, LONGEST_NS) * velocity)
    if later_R_camera is not None:
        camera_T_later = rigid(later_R_camera.T, camera_T_later[:3, 3])
    predicted = world_T_camera @ camera_T_later
    return rigid(nearest_rotation(predicted[:3, :3]), predicted[:3, 3])  # or rounding doubles with every image
