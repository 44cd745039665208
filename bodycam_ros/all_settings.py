"""Every group of settings that there is: one file serves all commands and nodes, each of which reads its own of it."""

from bodycam_ros.calibration.body_calibrator import CalibrationSettings
from bodycam_ros.mapping.map_settings import MapSettings
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.robot.retargeting import RobotSettings
from bodycam_ros.settings import SettingsGroups
from bodycam_ros.static_cameras.body_shape import MeasureSettings
from bodycam_ros.static_cameras.station_registration import StationsSettings

OF_COMMANDS: tuple[type[SettingsGroups], ...] = (
    MapSettings,
    MeasureSettings,
    StationsSettings,
    RobotSettings,
)
"""Those that no stage of the pipeline reads: commands do, and of the nodes only ``retarget`` its own."""

ALL: tuple[type[SettingsGroups], ...] = (PipelineSettings, CalibrationSettings, *OF_COMMANDS)


def all_groups() -> dict[str, type]:
    """Name of a group in a file -> its dataclass."""
    return {name: group for settings in ALL for name, group in settings.groups().items()}
