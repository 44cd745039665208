"""A keyframe of a worn camera: what it saw, and where it was when it saw it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.local_scale import scales_at
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.rolling_shutter import steady_pixels
from bodycam_ros.tracking.track_frame import NO_LANDMARK, TrackFrame


@dataclass(frozen=True)
class WornKeyframe:
    """Features of one image of a registered camera.

    Attributes:
        camera: its name.
        stamp_ns: of the image [ns].
        world_T_camera: (4, 4) where it was.
        position_sigma: how well that is known [m].
        focal_length: pixels per radian on its axis [px].
        bearings: (N, 3) unit rays to the features, in the camera.
        descriptors: (N, 128) uint8 RootSIFT.
        sizes: (N,) sigma, as the angle that it covers [rad].
        landmark_ids: (N,) uint32 landmarks that the features show; ``NO_LANDMARK``: none that is known.
    """

    camera: str
    stamp_ns: int
    world_T_camera: NDArray[np.float64]
    position_sigma: float
    focal_length: float
    bearings: NDArray[np.float64]
    descriptors: NDArray[np.uint8]
    sizes: NDArray[np.float64]
    landmark_ids: NDArray[np.uint32]


def worn_keyframe(camera: CameraModel, frame: TrackFrame, matches: LandmarkMatches) -> WornKeyframe | None:
    """The keyframe of an image in which new features were described; None if there are none, or the camera is lost.

    Args:
        camera: its model.
        frame: what the tracker said of the image.
        matches: what the registrar made of it.
    """
    if matches.world_T_camera is None or not len(frame.described):
        return None
    described = frame.described.astype(np.int64)
    readout_time = matches.readout.in_use if matches.readout else 0.0
    pixels = steady_pixels(camera, frame.pixels[described], matches.turning, readout_time)
    ids = np.full(len(described), NO_LANDMARK, np.uint32)
    _, at, of = np.intersect1d(frame.track_ids[described], matches.track_ids, return_indices=True)
    ids[at] = matches.landmark_ids[of]
    position_sigma = float(np.sqrt(np.trace(matches.pose_covariance[3:, 3:])))
    return keyframe_of_features(
        camera,
        frame.stamp_ns,
        matches.world_T_camera,
        position_sigma,
        pixels,
        frame.descriptors,
        frame.scales,
        ids,
    )


def keyframe_of_features(
    camera: CameraModel,
    stamp_ns: int,
    world_T_camera: NDArray[np.float64],
    position_sigma: float,
    pixels: NDArray[np.float64],
    descriptors: NDArray[np.uint8],
    scales: NDArray[np.float32],
    landmark_ids: NDArray[np.uint32],
) -> WornKeyframe:
    """The keyframe of an image with these features; those outside of the lens's cone are left out.

    Args:
        camera: its model.
        stamp_ns, world_T_camera, position_sigma: of the image, as of ``WornKeyframe``.
        pixels: (N, 2) where the features are, as if all rows were exposed together.
        descriptors, landmark_ids: (N, 128), (N,) as of ``WornKeyframe``.
        scales: (N,) sigma [px].
    """
    bearings, in_view = camera.unproject(pixels)
    return WornKeyframe(
        camera=camera.name,
        stamp_ns=stamp_ns,
        world_T_camera=world_T_camera,
        position_sigma=position_sigma,
        focal_length=float(np.sqrt(camera.fx * camera.fy)),
        bearings=bearings[in_view],
        descriptors=descriptors[in_view],
        sizes=scales[in_view] / scales_at(camera, bearings[in_view, 2]),
        landmark_ids=landmark_ids[in_view],
    )
