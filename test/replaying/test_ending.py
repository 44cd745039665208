"""A replay that is ended, at any time and in any way, leaves no traceback, no process and no file."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from bodycam_ros.cli.signals import EndingSignals
from bodycam_ros.files.whole_file import SCRATCH_PREFIX, write_whole
from bodycam_ros.replaying.worker_process import ready_to_start

TIME_S = 120.0
CODE_OF = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}


def start(sample: Path, folder: Path) -> "subprocess.Popen[str]":
    """A replay of the sample, in two processes beside it, in a process group of its own."""
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "replay", str(sample / "sample" / "bag"), "--jobs", "2"]
    command += ["--map", str(sample / "map"), "--body", str(sample / "body.yaml"), "-o", str(folder / "out")]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)


def wait_until(happened: Callable[[], object]) -> None:
    deadline = time.monotonic() + TIME_S
    while not happened():
        assert time.monotonic() < deadline, "it never came so far"
        time.sleep(0.02)


def group_of(process: "subprocess.Popen[str]") -> set[int]:
    """Processes of its group that live, zombies left out."""
    living = set()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, group = stat.read_text().rpartition(")")[2].split()[:3]
        except (OSError, ValueError):
            continue
        if int(group) == process.pid and state != "Z":
            living.add(int(stat.parent.name))
    return living


@pytest.mark.parametrize(
    ("number", "to_all"),
    [(signal.SIGINT, True), (signal.SIGTERM, False), (signal.SIGHUP, True), (signal.SIGHUP, False)],
)
def test_a_signal_amid_the_work_leaves_nothing_behind(
    sample: Path, tmp_path: Path, number: signal.Signals, to_all: bool
) -> None:
    process = start(sample, tmp_path)
    # Two workers, the process they are forked from, and the tracker of their semaphores: some are still starting.
    wait_until(lambda: process.poll() is not None or len(group_of(process)) == 5)
    time.sleep(0.3)
    os.killpg(process.pid, number) if to_all else process.send_signal(number)
    _, errors = process.communicate(timeout=TIME_S)
    assert process.returncode == CODE_OF[number]
    assert errors.strip() == ("bodycam: interrupted" if number == signal.SIGINT else "")
    assert list(tmp_path.iterdir()) == []
    wait_until(lambda: not group_of(process))


def test_workers_end_with_a_parent_that_is_killed_and_the_next_run_clears_up(sample: Path, tmp_path: Path) -> None:
    process = start(sample, tmp_path)
    wait_until(lambda: list(tmp_path.glob(f"{SCRATCH_PREFIX}*/out/*.mcap")))
    wait_until(lambda: len(group_of(process)) == 5)
    process.kill()
    process.communicate(timeout=TIME_S)
    wait_until(lambda: not group_of(process))
    (left,) = tmp_path.iterdir()
    os.utime(left, (0, 0))
    write_whole(tmp_path / "another_output", "text")
    assert [path.name for path in tmp_path.iterdir()] == ["another_output"]


_INTERRUPTED_WITHIN_EXEC = """
import sys
from bodycam_ros.cli.signals import EndingSignals
with EndingSignals() as signals:
    try:
        exec("import os, signal; os.kill(os.getpid(), signal.SIGINT)")
    except KeyboardInterrupt:
        sys.exit(signals.exit_code)
"""


def test_ctrl_c_within_an_import_gives_the_same_code(tmp_path: Path) -> None:
    (tmp_path / "interrupted.py").write_text(_INTERRUPTED_WITHIN_EXEC)
    paths = os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])])
    command = [sys.executable, "-m", "interrupted"]
    assert subprocess.run(command, env=os.environ | {"PYTHONPATH": paths}, check=False).returncode == 130


def test_a_signal_that_a_library_lost_ends_us_at_the_next_step() -> None:
    with EndingSignals():
        EndingSignals.check()
        with suppress(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            EndingSignals.check()
    EndingSignals.check()


def test_what_ends_us_is_answered_when_the_workers_have_started() -> None:
    """The signal comes on another thread than the one that has it blocked, as on a library's."""
    started = []
    with pytest.raises(KeyboardInterrupt), ready_to_start():
        sender = threading.Thread(target=lambda: os.kill(os.getpid(), signal.SIGINT))
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        sender.start()
        sender.join()
        time.sleep(0.05)
        started.append(True)
    assert started == [True]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
