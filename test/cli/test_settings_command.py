"""The parameter files in config/ against the settings in the code."""

from pathlib import Path

import pytest

from bodycam_ros.all_settings import all_groups
from bodycam_ros.cli.main import main
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.settings import read_settings_file, settings_from_mapping

CONFIG = Path(__file__).parents[2] / "config"


def test_the_committed_file_is_what_the_command_prints(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["settings"]) == 0
    printed = capsys.readouterr().out
    assert (CONFIG / "all_settings.yaml").read_text() == printed, "run: bodycam settings > config/all_settings.yaml"


def test_the_file_of_all_settings_holds_the_defaults() -> None:
    given = read_settings_file(CONFIG / "all_settings.yaml")
    groups = all_groups()
    assert given.keys() == groups.keys()
    for group, settings_type in groups.items():
        assert settings_from_mapping(settings_type, given[group], "all_settings.yaml") == settings_type()


def test_the_short_file_says_defaults_too() -> None:
    given = read_settings_file(CONFIG / "bodycam.yaml")
    assert given
    assert PipelineSettings.from_mapping(given, "bodycam.yaml") == PipelineSettings()
