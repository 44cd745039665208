"""One image by itself in the map: a photograph, or a frame of a camera that nobody has tracked.

It is the registration of a lost camera, with all that the image shows described at once: found anywhere in the map, its
pose fitted, its features named around that pose.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.lost_camera import AbsolutePoseSettings
from bodycam_ros.registration.matching import MatchingSettings
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.registrar import Registrar, RegistrarSettings
from bodycam_ros.settings import setting
from bodycam_ros.tracking.keypoints import KeypointDetector, Keypoints, KeypointSettings
from bodycam_ros.tracking.track_frame import TrackFrame


@dataclass(frozen=True)
class ImageRegistrationSettings:
    """What is looked for in an image that is registered by itself."""

    keypoints: int = setting(
        600, limits=(50, 20000), reason="the strongest; a quarter of them are landmarks where the map shows the place"
    )
    image_scale: float = setting(
        0.5, limits=(0.1, 1.0), reason="of the first attempt; at half size features cost a third"
    )
    contrast_threshold: float = setting(
        0.02, limits=(0.001, 0.2), reason="SIFT contrast; that of the photographs of the map"
    )


class ImageRegistration:
    """Registers images of one camera, each without regard to the others.

    Args:
        camera: that took them.
        reference_map: the map.
        settings: what is looked for.
        registrar, matching, absolute_pose, pose_fit: settings of the steps.
    """

    def __init__(
        self,
        camera: CameraModel,
        reference_map: ReferenceMap,
        settings: ImageRegistrationSettings | None = None,
        registrar: RegistrarSettings | None = None,
        matching: MatchingSettings | None = None,
        absolute_pose: AbsolutePoseSettings | None = None,
        pose_fit: PoseFitSettings | None = None,
    ) -> None:
        settings = settings or ImageRegistrationSettings()
        self._camera, self._map = camera, reference_map
        self._registrar, self._matching = registrar, matching
        self._absolute_pose, self._pose_fit = absolute_pose, pose_fit
        self._detectors = [
            KeypointDetector(KeypointSettings(scale, settings.contrast_threshold, settings.keypoints))
            for scale in sorted({settings.image_scale, 1.0})
        ]

    def register(self, image: NDArray[np.uint8], mask: NDArray[np.uint8] | None = None) -> LandmarkMatches:
        """Find the pose of the camera and the landmarks that the image shows, at its full size if a smaller one fails.

        Args:
            image: (height, width) grey.
            mask: zero where nothing is to be looked for.

        Returns:
            Whose ``world_T_camera`` is None if the image cannot be registered.
        """
        shown = np.full_like(image, 255) if mask is None else mask
        matches = self.register_keypoints(self._detectors[0].detect(image, shown))
        for detector in self._detectors[1:]:
            if matches.world_T_camera is not None:
                break
            matches = self.register_keypoints(detector.detect(image, shown))
        return matches

    def register_keypoints(self, keypoints: Keypoints) -> LandmarkMatches:
        """The same for features that are there already."""
        lost = Registrar(
            self._camera,
            self._map,
            settings=self._registrar,
            matching=self._matching,
            absolute_pose=self._absolute_pose,
            pose_fit=self._pose_fit,
        )
        return lost.register(_all_described(self._camera.name, keypoints))


def _all_described(camera: str, keypoints: Keypoints) -> TrackFrame:
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
