"""What a test starts does not outlive it."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

_SOON_S = 30.0
_STARTS_ANOTHER = """
import subprocess, sys
from ended_with_us import ended_with_us
sleeps = "import os, time; print(os.getpid(), flush=True); time.sleep(600)"
subprocess.Popen(ended_with_us([sys.executable, "-c", sleeps]), process_group=0).wait()
"""


@pytest.mark.skipif(shutil.which("setpriv") is None, reason="there is no setpriv here; it is part of util-linux")
def test_a_killed_test_leaves_nothing_behind() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", _STARTS_ANOTHER], stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parent
    ) as killed:
        assert killed.stdout is not None
        left = int(killed.stdout.readline())
        assert _is_running(left)
        killed.send_signal(signal.SIGKILL)
        killed.wait(_SOON_S)
    until_s = time.monotonic() + _SOON_S
    try:
        while _is_running(left) and time.monotonic() < until_s:
            time.sleep(0.02)
        assert not _is_running(left)
    finally:
        if _is_running(left):
            os.kill(left, signal.SIGKILL)


def _is_running(process: int) -> bool:
    """Whether it is there and no zombie, which nobody may have waited for yet."""
    stat = Path(f"/proc/{process}/stat")
    try:
        return stat.read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
