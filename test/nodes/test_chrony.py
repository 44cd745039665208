"""What chrony says of a clock: its own lines are understood, and nothing waits for it."""

import threading
from pathlib import Path

import pytest

from bodycam_ros.nodes.chrony import ChronyWatch, ask_chrony, tracking

FAST = (
    "7F000001,127.0.0.1,9,1795383380.205406232,-0.000001685,-0.000000062,0.000000281,0.012,-0.001,0.133,0.000007410,"
    "0.000001552,1.0,Normal"
)
"""As chronyc 4.3 printed it; without -c it said of the same "0.000001685 seconds fast of NTP time"."""

ALONE = (
    "00000000,,0,0.000000000,0.000000000,0.000000000,0.000000000,0.000,0.000,0.000,1.000000000,1.000000000,0.0,"
    "Not synchronised"
)
"""As it printed where no server could be reached."""


def test_a_clock_that_is_fast_is_ahead() -> None:
    steered = tracking(FAST)
    assert (steered.source, steered.is_synchronised) == ("127.0.0.1", True)
    assert steered.ahead_s == pytest.approx(1.685e-6)
    assert steered.bound_s == pytest.approx(1.685e-6 + 1.552e-6 + 7.41e-6 / 2)
    assert steered.text() == "+0.002 +- 0.007 ms by 127.0.0.1"


def test_a_clock_that_follows_nobody_is_told() -> None:
    assert tracking(ALONE).text() == "chrony runs, but follows no source"


@pytest.mark.parametrize("line", ["", "506 Cannot talk to daemon", FAST.replace("0.000001552", "x"), FAST + ",more"])
def test_what_is_no_such_line_is_refused(line: str) -> None:
    with pytest.raises(ValueError, match=r"fields|float"):
        tracking(line)


def put_chronyc(folder: Path, script: str) -> None:
    program = folder / "chronyc"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)


def test_chrony_is_asked_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert ask_chrony() == ""
    put_chronyc(tmp_path, "echo 506 Cannot talk to daemon; exit 1")
    assert ask_chrony() == ""
    put_chronyc(tmp_path, f"[ \"$*\" = '-c tracking' ] && echo '{FAST}'")
    assert ask_chrony() == tracking(FAST).text()


def test_a_watch_asks_beside_everything_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    asked = threading.Event()

    def ask() -> str:
        asked.set()
        return "in time"

    assert ChronyWatch(ask).latest == ""
    assert not asked.is_set(), "chrony is not installed"
    put_chronyc(tmp_path, "true")
    ChronyWatch(ask)
    assert asked.wait(10.0)
