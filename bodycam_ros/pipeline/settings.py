"""Settings of all stages, apart from these: every node and command reads them, few run all stages."""

from dataclasses import dataclass

from bodycam_ros.estimation.attachments import CouplingSettings
from bodycam_ros.estimation.contact import ContactSettings
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.estimation.inertial_factors import InertialSettings
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.estimation.mounted_cameras import EvidenceSettings
from bodycam_ros.mapping.map_settings import ExtensionSettings
from bodycam_ros.registration.direct_registration import DirectSettings
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.registration.registrar import RegistrarSettings
from bodycam_ros.settings import SettingsGroups
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.timing.clock_state import ClockSettings
from bodycam_ros.timing.frame_assembler import AssemblerSettings
from bodycam_ros.tracking.image_rate import ImageSettings
from bodycam_ros.tracking.keypoints import KeypointSettings


@dataclass(frozen=True)
class PipelineSettings(SettingsGroups):
    """Settings of all stages between an image and the body."""

    images: ImageSettings = ImageSettings()
    keypoints: KeypointSettings = KeypointSettings()
    registrar: RegistrarSettings = RegistrarSettings()
    extension: ExtensionSettings = ExtensionSettings()
    direct: DirectSettings = DirectSettings()
    pose_fit: PoseFitSettings = PoseFitSettings()
    clock: ClockSettings = ClockSettings()
    assembler: AssemblerSettings = AssemblerSettings()
    estimator: EstimatorSettings = EstimatorSettings()
    motion: MotionSettings = MotionSettings()
    contact: ContactSettings = ContactSettings()
    evidence: EvidenceSettings = EvidenceSettings()
    coupling: CouplingSettings = CouplingSettings()
    inertial: InertialSettings = InertialSettings()
    region: RegionSettings = RegionSettings()
