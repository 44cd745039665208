"""Sliding of standing feet: what slides by a known way is measured so, and only while it stands."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import FRAME_NS, STANDS, standing, write_solved, write_truth

from bodycam_ros.cli.main import main
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.sliding import ALL

CREEP = 0.02  # [m/s]
SPAN_M = CREEP * (STANDS - 1) * 1e-9 * FRAME_NS
MEAN_M = 0.25 * SPAN_M * (1.0 + 1.0 / STANDS)
"""Mean of the distances from the middle, at an odd number of even steps."""


def test_a_foot_that_creeps_slides_by_a_quarter_of_its_way(tmp_path: Path) -> None:
    measured = evaluate(write_solved(standing(CREEP), tmp_path / "out")).figures.sliding
    assert set(measured) == {"foot_left", ALL}
    assert measured[ALL] == measured["foot_left"]
    foot = measured["foot_left"]
    assert foot.stances == 2  # heel and ball
    assert foot.standing_s == pytest.approx(2e-9 * FRAME_NS * (STANDS - 1))
    assert foot.path_mm == pytest.approx(1e3 * SPAN_M, rel=1e-5)
    assert foot.max_mm == pytest.approx(1e3 * SPAN_M / 2.0, rel=1e-5)
    assert foot.mean_mm == pytest.approx(1e3 * MEAN_M, rel=1e-5)


def test_against_the_truth_what_it_does_itself_is_no_error(tmp_path: Path) -> None:
    out = write_solved(standing(CREEP), tmp_path / "out")
    alike = evaluate(out, write_truth(standing(CREEP), tmp_path / "alike")).figures.sliding["foot_left"]
    assert alike.true_mean_mm == pytest.approx(alike.mean_mm, rel=1e-5)
    assert alike.beyond_mean_mm < 1e-3
    still = evaluate(out, write_truth(standing(0.0), tmp_path / "still")).figures.sliding["foot_left"]
    assert still.true_mean_mm < 1e-3
    assert still.beyond_mean_mm == pytest.approx(1e3 * MEAN_M, rel=1e-5)


def test_a_foot_high_up_or_in_motion_does_not_stand(tmp_path: Path) -> None:
    high = evaluate(write_solved(standing(0.0, height=0.3), tmp_path / "high")).figures.sliding["foot_left"]
    assert high.stances == 0
    assert np.isnan(high.mean_mm)
    assert evaluate(write_solved(standing(0.2), tmp_path / "fast")).figures.sliding["foot_left"].stances == 0


def test_a_gap_ends_a_stance(tmp_path: Path) -> None:
    gap = standing(0.0).without(list(range(12, 20)))
    assert evaluate(write_solved(gap, tmp_path / "out")).figures.sliding["foot_left"].stances == 4


def test_the_command_tells(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = write_solved(standing(CREEP), tmp_path / "out")
    truth = write_truth(standing(0.0), tmp_path / "truth")
    main(["evaluate", str(out), "--truth", str(truth), "-o", str(tmp_path / "report")])
    said = capsys.readouterr().out
    assert "sliding of feet in stance" in said
    assert "beyond it" in said
    figures = json.loads((tmp_path / "report" / "summary.json").read_text())
    assert figures["sliding"]["foot_left"]["path_mm"] == pytest.approx(1e3 * SPAN_M, rel=1e-5)
    assert figures["sliding"]["all"]["beyond_mean_mm"] == pytest.approx(1e3 * MEAN_M, rel=1e-5)
