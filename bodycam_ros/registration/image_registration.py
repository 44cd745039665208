"""One image by itself in the map: a photograph, or a frame of a camera that is not tracked.

It is the registration of a lost camera: all keypoints described at once, the camera relocalised, its pose fitted, its
keypoints matched around that pose.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.registrar import RegisteredCamera, Registrar, RegistrarSettings
from bodycam_ros.tracking.keypoints import KeypointDetector, Keypoints, KeypointSettings
from bodycam_ros.tracking.track_frame import TrackFrame

_KEYPOINTS = 600  # the strongest; a quarter of them are landmarks where the map has the place
_SCALES = (0.5, 1.0)  # sizes of the image in turn; at half size features cost a third


class ImageRegistration:
    """Registers images of one camera, each without regard to the others.

    Args:
        camera: that took them.
        reference_map: the map.
        registrar, pose_fit: settings of the steps.
        keypoints: the strongest of an image.
    """

    def __init__(
        self,
        camera: CameraModel,
        reference_map: ReferenceMap,
        registrar: RegistrarSettings | None = None,
        pose_fit: PoseFitSettings | None = None,
        keypoints: int = _KEYPOINTS,
    ) -> None:
        self._camera = camera
        self._registrar = Registrar(camera, reference_map, registrar, pose_fit)
        self._detectors = [
            KeypointDetector(KeypointSettings(image_scale=scale, max_keypoints=keypoints)) for scale in _SCALES
        ]

    def register(self, image: NDArray[np.uint8], mask: NDArray[np.uint8] | None = None) -> LandmarkMatches:
        """Find the pose of the camera and the landmarks in the image, at its full size if a smaller one fails.

        Args:
            image: (height, width) grey.
            mask: zero where keypoints are ignored.

        Returns:
            Whose ``world_T_camera`` is None if the image cannot be registered.
        """
        mask = np.full_like(image, 255) if mask is None else mask
        for detector in self._detectors:
            frame = _frame_of_keypoints(self._camera.name, detector.detect(image, mask))
            _, matches = self._registrar.register(RegisteredCamera(), frame)
            if matches.world_T_camera is not None:
                break
        return matches


def _frame_of_keypoints(camera: str, keypoints: Keypoints) -> TrackFrame:
    """Keypoints as the tracks of a first image, the strongest first."""
    order = np.argsort(-keypoints.responses, kind="stable")
    rows = np.arange(len(order), dtype=np.uint32)
    return TrackFrame(
        camera=camera,
        stamp_ns=0,
        previous_stamp_ns=0,
        track_ids=rows,
        pixels=keypoints.pixels[order],
        described=rows,
        descriptors=keypoints.descriptors[order],
        scales=keypoints.scales[order],
        keyframe=True,
        current_R_previous=np.eye(3),
        rotation_inliers=0,
    )
