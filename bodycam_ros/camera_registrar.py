"""The registrar of one camera, with its settings out of those of all stages."""

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.registrar import Registrar


def registrar(
    camera: CameraModel, reference_map: ReferenceMap, settings: PipelineSettings, readout: Readout | None = None
) -> Registrar:
    """The registrar of one camera, with what is known beforehand of how its rows are read out."""
    return Registrar(
        camera,
        reference_map,
        settings.registrar,
        settings.matching,
        settings.absolute_pose,
        settings.pose_fit,
        settings.shutter,
        readout,
    )
