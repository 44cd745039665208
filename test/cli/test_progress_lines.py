"""Long work without a terminal prints where it is, also where it reports nothing."""

import time

import pytest

from bodycam_ros.cli import progress_lines
from bodycam_ros.cli.output import shown_progress


def test_a_silent_step_is_named_every_few_seconds(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress_lines, "_EVERY_S", 0.05)
    with shown_progress() as progress, progress.step("matching photographs", 4) as advance:
        advance()
        time.sleep(0.3)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) >= 2
    assert {line.partition(" after ")[0] for line in lines} == {"bodycam: matching photographs: 25%"}


def test_quick_work_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with shown_progress() as progress, progress.step("reading", 1):
        pass
    assert capsys.readouterr().err == ""
