"""Help and usage of commands: short, at once, and settings where they are asked for."""

import shlex
import subprocess
import sys

import pytest

from bodycam_ros.cli.main import COMMANDS, _parser, main
from bodycam_ros.cli.the_way import THE_WAY
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.settings import describe

HEAVY = ("cv2", "gtsam", "matplotlib", "numba", "numpy", "pycolmap", "scipy", "viser")
"""Each takes a tenth of a second or more to load."""

WITH_SETTINGS = ("map", "map check", "map extend", "ingest", "stations", "body", "replay")


def said_by(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[object, str, str]:
    """Exit code, what went to stdout and what to stderr."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return ended.value.code, *capsys.readouterr()


def test_flags_of_every_command_are_known_without_what_is_heavy() -> None:
    # The formats of export know their writers.
    commands = [command for command in COMMANDS if command != "export"]
    code = (
        "import sys; from bodycam_ros.cli.main import _parser\n"
        f"for command in {commands}: _parser([command]).format_help()\n"
        f"print([name for name in {HEAVY} if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "[]\n"


def test_a_missing_argument_is_said_in_a_few_lines(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = said_by(capsys, "replay", "walk", "--map", "map", "-o", "out")
    assert (code, out) == (2, "")
    assert err.splitlines() == [
        "usage: bodycam replay BAG --body BODY -o OUT [options]",
        "bodycam replay: error: the following arguments are required: --body",
        "'bodycam replay --help' explains it",
    ]


@pytest.mark.parametrize("command", WITH_SETTINGS)
def test_help_is_short_and_leads_to_the_settings(capsys: pytest.CaptureFixture[str], command: str) -> None:
    code, out, _ = said_by(capsys, command, "--help")
    assert code == 0
    assert len(out.splitlines()) <= 45
    assert "--help-settings" in out
    assert "\nsettings of " not in out
    code, explained, _ = said_by(capsys, command, "--help-settings")
    assert code == 0
    assert len(explained) > len(out) and "\nsettings of " in explained


def test_all_settings_are_explained_when_asked(capsys: pytest.CaptureFixture[str]) -> None:
    _, explained, _ = said_by(capsys, "replay", "--help-settings")
    for group, settings_type in PipelineSettings.groups().items():
        for description in describe(settings_type):
            assert f"--{group}.{description.name} " in explained


@pytest.mark.parametrize("words", [("--smoother.output_delay", "2"), ("--smoother.output_delay=2",)])
def test_a_setting_needs_no_asking(words: tuple[str, ...]) -> None:
    arguments = ["replay", "walk", "--body", "body.yaml", "-o", "out", *words]
    assert getattr(_parser(arguments).parse_args(arguments), "smoother.output_delay") == 2


def test_a_setting_that_is_none_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = said_by(capsys, "replay", "walk", "--body", "body.yaml", "-o", "out", "--smoother.colour", "2")
    assert code == 2
    assert "unrecognized arguments: --smoother.colour" in err


def test_without_arguments_it_shows_the_way(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    out, err = capsys.readouterr()
    assert (out, err) == (THE_WAY, "")
    assert max(map(len, out.splitlines())) < 84


def test_every_step_of_the_way_is_a_command_that_exists() -> None:
    steps = [line.strip() for line in THE_WAY.splitlines() if line.startswith("       bodycam ")]
    assert len(steps) >= 7
    for step in steps:
        words = shlex.split(step.replace("FORMAT", "urdf"))[1:]
        assert _parser(words).parse_args(words).run
