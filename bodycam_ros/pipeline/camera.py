"""One camera from images to registrations, offline; the live graph runs the two halves of it in different nodes."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.files.shown import few
from bodycam_ros.inertial.camera_turn import CameraTurn
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.mapping.body_keyframe import BodyKeyframe, KeyframeDensity, KeyframeSelection
from bodycam_ros.mapping.extendable_map import ExtendableMap
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.landmark_tracker import LandmarkTracker
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.registrar import Registrar
from bodycam_ros.tracking.feature_tracker import FeatureTracker
from bodycam_ros.tracking.track_frame import TrackFrame


def landmark_tracker(
    camera: CameraModel,
    reference_map: ReferenceMap | None,
    settings: PipelineSettings,
    readout: Readout | None = None,
    turn: CameraTurn | None = None,
) -> LandmarkTracker:
    """The tracker of one camera; without a map, or with one without photographs, it tracks features alone."""
    features = FeatureTracker(camera, settings.keypoints)
    return LandmarkTracker(features, reference_map, settings.direct, settings.pose_fit, readout, turn)


def registrar(
    camera: CameraModel, reference_map: ReferenceMap, settings: PipelineSettings, readout: Readout | None = None
) -> Registrar:
    """The registrar of one camera, with its read-out time as far as it is known beforehand."""
    return Registrar(camera, reference_map, settings.registrar, settings.pose_fit, readout)


def camera_turns(body: BodyModel, imus: Mapping[str, ImuSamples]) -> dict[str, CameraTurn]:
    """Camera -> its turns, of cameras whose sensor is calibrated and has samples."""
    calibrations = {camera: mount.imu for camera, mount in body.mounts.items()}
    return {
        camera: CameraTurn(calibration, samples)
        for camera, samples in imus.items()
        if (calibration := calibrations.get(camera)) is not None and len(samples)
    }


def unused_sensors(body: BodyModel, imus: Mapping[str, ImuSamples]) -> list[str]:
    """A remark on inertial sensors that have samples and are not used, and on those that have none that can be."""
    on_body = {camera: body.mounts[camera].imu for camera in imus if camera in body.mounts}
    uncalibrated = [camera for camera, calibration in sorted(on_body.items()) if calibration is None]
    remarks = []
    if uncalibrated:
        remarks.append(
            f"inertial sensors of {few(uncalibrated)} are not used: body {body.name} has no calibration of them; "
            "make it of a range of motion with their samples ('bodycam body')"
        )
    for camera in sorted(on_body.keys() - {*uncalibrated}):
        if not len(imus[camera]):
            reason = imus[camera].left_out or "there are none"
            remarks.append(f"camera {camera}: its inertial sensor has no usable samples ({reason}); it is left out")
    return remarks


class CameraPipeline:
    """One camera from images to registrations.

    Args:
        camera: its model.
        reference_map: what its tracker finds landmarks by.
        settings: of all stages.
        readout: as of ``registrar``.
        extendable_map: what it is registered in, if not that map; the same with room for more landmarks.
        turn: as of ``LandmarkTracker``.
        keyframes: how many images become keyframes; None: as many as extend a map, and none without such a map.
    """

    def __init__(
        self,
        camera: CameraModel,
        reference_map: ReferenceMap,
        settings: PipelineSettings,
        readout: Readout | None = None,
        extendable_map: ExtendableMap | None = None,
        turn: CameraTurn | None = None,
        keyframes: KeyframeDensity | None = None,
    ) -> None:
        self._tracker = landmark_tracker(camera, reference_map, settings, readout, turn)
        self._registrar = registrar(camera, extendable_map or reference_map, settings, readout)
        is_extended = extendable_map is not None or keyframes is not None
        self._keyframes = KeyframeSelection(camera, keyframes) if is_extended else None

    def process(
        self, image: NDArray[np.uint8], stamp_ns: int
    ) -> tuple[TrackFrame, LandmarkMatches, BodyKeyframe | None]:
        """Track and register the next image (H, W); what the map may grow by, if it is a keyframe.

        Raises:
            RecordingError: as ``FeatureTracker.track``.
        """
        tracks = self._tracker.track(image, stamp_ns)
        matches = self._registrar.register(tracks)
        self._tracker.add_registration(matches)
        if self._keyframes is None:
            return tracks, matches, None
        keyframe = self._keyframes.take_keyframe(tracks, matches)
        if keyframe is None and self._keyframes.is_due(matches):
            self._tracker.want_keyframe()
        return tracks, matches, keyframe
