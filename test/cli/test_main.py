"""The command line as a person meets it: real processes for signals and exit codes."""

import argparse
import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

import bodycam_ros
from bodycam_ros.cli import main as command_line
from bodycam_ros.cli.signals import SIGNALS
from bodycam_ros.errors import RecordingError


def run_with(monkeypatch: pytest.MonkeyPatch, run: Callable[[argparse.Namespace], int]) -> int:
    """Exit code of ``bodycam probe`` where probe is a command that does what ``run`` does."""
    probe = SimpleNamespace(add_arguments=lambda parser: None, run=run)
    monkeypatch.setattr(command_line, "COMMANDS", {"probe": "probe"})
    monkeypatch.setitem(sys.modules, "bodycam_ros.cli.probe", probe)
    before = [signal.getsignal(number) for number in SIGNALS]
    code = command_line.main(["probe"])
    assert [signal.getsignal(number) for number in SIGNALS] == before
    return code


def test_exit_code_of_the_command_is_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    assert run_with(monkeypatch, lambda arguments: 0) == 0
    assert run_with(monkeypatch, lambda arguments: 3) == 3


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["probe", "deep", "well"], "deep: well"),
        (["-v", "probe", "deep", "deep"], "deep: deep"),
        (["probe", "well"], "well"),
        (["probe", "./deep"], "./deep"),
        (["probe", "--force", "deep"], "deep"),
    ],
)
def test_a_command_may_have_two_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    class Probe:
        prefix = ""

        @staticmethod
        def add_arguments(parser: argparse.ArgumentParser) -> None:
            parser.add_argument("source")
            parser.add_argument("--force", action="store_true")

        @classmethod
        def run(cls, arguments: argparse.Namespace) -> int:
            print(cls.prefix + arguments.source)
            return 0

    class ProbeDeep(Probe):
        prefix = "deep: "

    monkeypatch.setattr(command_line, "COMMANDS", {"probe": "probe", "probe deep": "probe deeper"})
    monkeypatch.setitem(sys.modules, "bodycam_ros.cli.probe", Probe)
    monkeypatch.setitem(sys.modules, "bodycam_ros.cli.probe_deep", ProbeDeep)
    assert command_line.main(words) == 0
    assert capsys.readouterr().out == f"{said}\n"


def test_errors_of_the_user_are_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def fail(arguments: argparse.Namespace) -> int:
        raise RecordingError("walk.mcap: is cut off")

    assert run_with(monkeypatch, fail) == 1
    assert capsys.readouterr().err == "bodycam: error: walk.mcap: is cut off\n"


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (OSError(errno.ENAMETOOLONG, "File name too long", "x" * 300), "x" * 300 + ": File name too long"),
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
        (
            MemoryError(),
            "there is not enough memory for this; give fewer processes (--jobs), or smaller input",
        ),
        (RecordingError("topic /\x1b[2J\x9bcam\udcfc"), r"topic /\x1b[2J\x9bcam\udcfc"),
    ],
)
def test_what_the_machine_refuses_is_one_line_that_a_terminal_can_bear(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: Exception, told: str
) -> None:
    def fail(arguments: argparse.Namespace) -> int:
        raise error

    assert run_with(monkeypatch, fail) == 1
    assert capsys.readouterr().err == f"bodycam: error: {told}\n"


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


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_every_signal_that_ends_a_command_cleans_up(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], number: int, code: int
) -> None:
    """Even if it comes twice, and something turns it into another error on its way."""
    cleaned = []

    def wait(arguments: argparse.Namespace) -> int:
        try:
            os.kill(os.getpid(), number)
            signal.pause()
        except BaseException as error:
            os.kill(os.getpid(), number)
            cleaned.append(True)
            raise ImportError("numpy failed to import") from error
        return 0

    assert (run_with(monkeypatch, wait), cleaned) == (code, [True])
    assert "Traceback" not in capsys.readouterr().err


def test_a_signal_that_comes_while_an_object_is_destroyed_is_not_lost(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Dying:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGTERM)
            for _ in range(1000):
                pass

    def destroy(arguments: argparse.Namespace) -> int:
        del_me = Dying()
        del del_me
        time.sleep(5)
        return 0

    assert run_with(monkeypatch, destroy) == 143
    assert capsys.readouterr().err == ""


def bodycam(*arguments: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "bodycam_ros.cli.main", *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=Path(bodycam_ros.__file__).parent.parent
    )


def test_version() -> None:
    result = bodycam("--version")
    assert (result.returncode, result.stdout) == (0, f"bodycam {bodycam_ros.__version__}\n")


@pytest.mark.parametrize("arguments", [("-v",), ("juggle",), ("--juggle",)])
def test_wrong_usage_is_2_and_shows_usage(arguments: tuple[str, ...]) -> None:
    result = bodycam(*arguments)
    assert result.returncode == 2
    assert result.stderr.startswith("usage: bodycam")


def test_help_lists_every_command() -> None:
    result = bodycam("--help")
    assert result.returncode == 0
    for command in command_line.COMMANDS:
        assert f"    {command} " in result.stdout


def test_missing_recording_is_a_clear_error(tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    result = bodycam("replay", "nowhere.mcap", "--map", "map", "--body", "body.yaml", "-o", out)
    assert result.returncode == 1
    assert result.stderr.startswith("bodycam: error: nowhere.mcap: does not exist")


@pytest.mark.parametrize("jobs", ["0", "-1", "many"])
@pytest.mark.parametrize("command", ["map", "ingest", "body", "replay", "doctor", "run"])
def test_no_command_works_with_no_jobs(command: str, jobs: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        command_line.main([command, "somewhere", "-o", "out", "--jobs", jobs])
    assert ended.value.code == 2
    assert "--jobs" in capsys.readouterr().err
