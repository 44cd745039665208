"""The settings of stages and calibration as parameters."""

from pathlib import Path

import pytest

from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.errors import SettingsError
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.settings import read_settings_file

ALL_SETTINGS = Path(__file__).parents[2] / "config/all_settings.yaml"

pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")


def test_the_file_of_all_settings_serves_the_nodes() -> None:
    from bodycam_ros.nodes.parameters import settings_from_parameters

    groups = read_settings_file(ALL_SETTINGS)
    given = {f"{group}.{name}": value for group, values in groups.items() for name, value in values.items()}
    assert settings_from_parameters(given) == (PipelineSettings(), CalibrationSettings())
    pipeline, calibration = settings_from_parameters({"smoother.output_delay": 3, "motion_log.max_images": 300})
    assert (pipeline.smoother.output_delay, calibration.motion_log.max_images) == (3, 300)


def test_a_recording_alone_can_be_solved_as_a_whole() -> None:
    from bodycam_ros.nodes.parameters import settings_from_parameters

    with pytest.raises(SettingsError, match="output_delay is 'offline', which solves a recording as a whole"):
        settings_from_parameters({"smoother.output_delay": "offline"})


@pytest.mark.parametrize("name", ["motion_lock.max_images", "motion_log.max_image"])
def test_a_name_that_is_none(name: str) -> None:
    from bodycam_ros.nodes.parameters import settings_from_parameters

    with pytest.raises(SettingsError, match=name.split(".")[name.startswith("motion_log.")]):
        settings_from_parameters({name: 300})
