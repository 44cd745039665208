"""The command line as a person meets it: real processes for signals and exit codes."""

import argparse
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import bodycam_ros
from bodycam_ros.cli import main as command_line
from bodycam_ros.errors import RecordingError


def run_with(monkeypatch: pytest.MonkeyPatch, run: Callable[[argparse.Namespace], int]) -> int:
    """Exit code of ``bodycam probe`` where probe is a command that does what ``run`` does."""

    class Probe:
        @staticmethod
        def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
            subparsers.add_parser("probe").set_defaults(run=run)

    monkeypatch.setattr(command_line, "COMMANDS", ("probe",))
    monkeypatch.setitem(sys.modules, "bodycam_ros.cli.probe", Probe)
    before = signal.getsignal(signal.SIGTERM)
    try:
        return command_line.main(["probe"])
    finally:
        signal.signal(signal.SIGTERM, before)


def test_exit_code_of_the_command_is_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    assert run_with(monkeypatch, lambda arguments: 0) == 0
    assert run_with(monkeypatch, lambda arguments: 3) == 3


def test_errors_of_the_user_are_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def fail(arguments: argparse.Namespace) -> int:
        raise RecordingError("walk.mcap: is cut off")

    assert run_with(monkeypatch, fail) == 1
    assert capsys.readouterr().err == "bodycam: error: walk.mcap: is cut off\n"


def test_ctrl_c_is_130(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupt(arguments: argparse.Namespace) -> int:
        os.kill(os.getpid(), signal.SIGINT)
        signal.pause()
        return 0

    assert run_with(monkeypatch, interrupt) == 130
    assert "Traceback" not in capsys.readouterr().err


def test_defects_of_ours_are_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def stumble(arguments: argparse.Namespace) -> int:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run_with(monkeypatch, stumble)


def test_termination_cleans_up(monkeypatch: pytest.MonkeyPatch) -> None:
    cleaned = []

    def wait(arguments: argparse.Namespace) -> int:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            signal.pause()
        finally:
            cleaned.append(True)
        return 0

    with pytest.raises(SystemExit) as caught:
        run_with(monkeypatch, wait)
    assert (caught.value.code, cleaned) == (143, [True])


def bodycam(*arguments: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "bodycam_ros.cli.main", *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=Path(bodycam_ros.__file__).parent.parent
    )


def test_version() -> None:
    result = bodycam("--version")
    assert (result.returncode, result.stdout) == (0, f"bodycam {bodycam_ros.__version__}\n")


@pytest.mark.parametrize("arguments", [(), ("juggle",), ("--juggle",)])
def test_wrong_usage_is_2_and_shows_usage(arguments: tuple[str, ...]) -> None:
    result = bodycam(*arguments)
    assert result.returncode == 2
    assert result.stderr.startswith("usage: bodycam")


def test_help_lists_every_command() -> None:
    result = bodycam("--help")
    assert result.returncode == 0
    for command in command_line.COMMANDS:
        assert f"    {command} " in result.stdout


def test_missing_recording_is_a_clear_error() -> None:
    result = bodycam("replay", "nowhere.mcap", "--map", "map", "--body", "body.yaml", "-o", "out")
    assert result.returncode == 1
    assert result.stderr.startswith("bodycam: error: nowhere.mcap: does not exist")
