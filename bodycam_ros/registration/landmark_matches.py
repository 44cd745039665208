"""The registration of one image."""

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.readout import Readout
from bodycam_ros.geometry import log_so3
from bodycam_ros.tracking.track_frame import TrackFrame


@dataclass(frozen=True)
class LandmarkMatches:
    """The landmarks of the reference map in one image of one camera.

    Attributes:
        camera: the camera's name.
        stamp_ns: mid-exposure of the middle row [ns].
        previous_stamp_ns: stamp of the frame that ``current_R_previous`` starts from; 0 if there is none.
        track_ids: (N,) uint32, their tracks.
        landmark_ids: (N,) uint32 the landmarks.
        pixels: (N, 2) float32, in the image if all its rows were exposed with the middle one.
        points_world: (N, 3) float32 their places [m].
        world_T_camera: (4, 4) pose from absolute registration (A 4.1), or None when the camera is lost.
        pose_covariance: (6, 6), rotation [rad] then translation [m], both in camera axes.
        current_R_previous: (3, 3) rotation of the camera between the two frames (A eq. 2).
        rotation_inliers: tracks that agree with that rotation; 0 if it is unknown.
        shifts: (N, 2) float32, how far the read-out of the rows moved them; None if it did not.
        readout: how long the camera's rows are read out, as far as it is known by now; None: not at all.
        grown: how many of the landmarks body cameras added.
        map_identity: text of the ``MapIdentity`` of the landmarks and the pose; empty if it is not known.
        tracks_map_identity: that of the map by which the tracks were found; empty if they were found without one.
    """

    camera: str
    stamp_ns: int
    previous_stamp_ns: int
    track_ids: NDArray[np.uint32]
    landmark_ids: NDArray[np.uint32]
    pixels: NDArray[np.float32]
    points_world: NDArray[np.float32]
    world_T_camera: NDArray[np.float64] | None
    pose_covariance: NDArray[np.float64]
    current_R_previous: NDArray[np.float64]
    rotation_inliers: int
    shifts: NDArray[np.float32] | None = None
    readout: Readout | None = None
    grown: int = 0
    map_identity: str = ""
    tracks_map_identity: str = ""

    def bare(self) -> "LandmarkMatches":
        """The same without the landmarks; ``grown`` is 1 if most of them were added by body cameras, else 0."""
        nothing = slice(0)
        return replace(
            self,
            track_ids=self.track_ids[nothing],
            landmark_ids=self.landmark_ids[nothing],
            pixels=self.pixels[nothing],
            points_world=self.points_world[nothing],
            shifts=None,
            grown=int(2 * self.grown > len(self.landmark_ids)),
        )

    @property
    def shown(self) -> NDArray[np.float32]:
        """(N, 2) their places in the image itself [px]."""
        return self.pixels if self.shifts is None else self.pixels + self.shifts

    @property
    def readout_in_use(self) -> float:
        """What pixels are corrected by [s]: zero as long as it is unknown, or cannot be told from zero."""
        return self.readout.in_use if self.readout else 0.0

    @property
    def position_sigma(self) -> float:
        """Standard deviation of the camera's position [m]; NaN of one that is lost."""
        return float(np.sqrt(np.trace(self.pose_covariance[3:, 3:])))

    @property
    def turning(self) -> NDArray[np.float64]:
        """(3,) angular velocity since the image before, in camera axes [rad/s]; zero where it is unknown."""
        if not self.rotation_inliers:
            return np.zeros(3)
        since_s = 1e-9 * (self.stamp_ns - self.previous_stamp_ns)
        turning: NDArray[np.float64] = log_so3(self.current_R_previous.T) / since_s
        return turning


def unregistered(frame: TrackFrame) -> LandmarkMatches:
    """The registration of an image of which no track is used: without landmarks and pose, with its rotation."""
    return LandmarkMatches(
        camera=frame.camera,
        stamp_ns=frame.stamp_ns,
        previous_stamp_ns=frame.previous_stamp_ns,
        track_ids=np.zeros(0, np.uint32),
        landmark_ids=np.zeros(0, np.uint32),
        pixels=np.zeros((0, 2), np.float32),
        points_world=np.zeros((0, 3), np.float32),
        world_T_camera=None,
        pose_covariance=np.full((6, 6), np.nan),
        current_R_previous=frame.current_R_previous,
        rotation_inliers=frame.rotation_inliers,
    )


class CameraSight(IntEnum):
    """How well a camera was located in an image, from the best; of several images the worst is the greatest."""

    REGISTERED = 0
    """In the reference map (A 4.1): nothing drifts."""
    RELATIVE = 1
    """By landmarks of which most were added by body cameras."""
    ROTATION_ONLY = 2
    """No pose, but the rotation since the image before (A eq. 2)."""
    BLIND = 3
    """Nothing: a black, blurred or bare picture."""

    @property
    def label(self) -> str:
        """The name for display."""
        return self.name.lower().replace("_", " ")


def camera_sight(matches: LandmarkMatches) -> CameraSight:
    """How well a camera was located in an image."""
    if matches.world_T_camera is not None:
        grown_prevail = 2 * matches.grown > len(matches.landmark_ids)
        return CameraSight.RELATIVE if grown_prevail else CameraSight.REGISTERED
    return CameraSight.ROTATION_ONLY if matches.rotation_inliers else CameraSight.BLIND
