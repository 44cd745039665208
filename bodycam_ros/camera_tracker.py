"""The tracker of one camera, with its settings out of those of all stages."""

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.registration.landmark_tracker import LandmarkTracker
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.feature_tracker import FeatureTracker


def landmark_tracker(
    camera: CameraModel, reference_map: ReferenceMap | None, settings: PipelineSettings, readout: Readout | None = None
) -> LandmarkTracker:
    """The tracker of one camera; without a map, or with one without photographs, it tracks features alone."""
    features = FeatureTracker(camera, settings.tracker, settings.keypoints, settings.flow, settings.rotation)
    return LandmarkTracker(features, reference_map, settings.direct, settings.pose_fit, settings.shutter, readout)
