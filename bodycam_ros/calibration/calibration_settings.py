"""All settings that a body is calibrated with, by group."""

from dataclasses import dataclass

from bodycam_ros.calibration.anthropometry import AnthropometrySettings
from bodycam_ros.calibration.assessment import AssessmentSettings
from bodycam_ros.calibration.camera_motion import MotionLogSettings
from bodycam_ros.calibration.joint_centre import JointCentreSettings
from bodycam_ros.calibration.joint_limits import JointLimitSettings
from bodycam_ros.calibration.refinement import RefinementSettings
from bodycam_ros.calibration.rest_pose import RestPoseSettings
from bodycam_ros.calibration.strap_slip import StrapSlipSettings
from bodycam_ros.calibration.virtual_camera import VirtualCameraSettings
from bodycam_ros.settings import SettingsGroups


@dataclass(frozen=True)
class CalibrationSettings(SettingsGroups):
    """Settings of every step of a calibration."""

    motion_log: MotionLogSettings = MotionLogSettings()
    strap_slip: StrapSlipSettings = StrapSlipSettings()
    virtual_camera: VirtualCameraSettings = VirtualCameraSettings()
    joint_centre: JointCentreSettings = JointCentreSettings()
    rest_pose: RestPoseSettings = RestPoseSettings()
    refinement: RefinementSettings = RefinementSettings()
    joint_limits: JointLimitSettings = JointLimitSettings()
    assessment: AssessmentSettings = AssessmentSettings()
    anthropometry: AnthropometrySettings = AnthropometrySettings()
