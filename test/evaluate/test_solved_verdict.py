"""The verdict on a solved bag: the body as it was published, and what does not fit it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import Walk, write_solved
from msgspec.structs import asdict

from bodycam_ros.body.body_model import CameraMount
from bodycam_ros.evaluate.evaluation import evaluate, solved_verdict
from bodycam_ros.evaluate.report import write_report
from bodycam_ros.evaluate.summary_picture import verdict_line
from bodycam_ros.geometry import rigid
from bodycam_ros.results.solved_recording import read_solved
from bodycam_ros.results.verdict import Finding, Level, Verdict, parse_verdict, verdict_text


def test_a_good_walk_is_good(solved: Path) -> None:
    evaluation = evaluate(solved)
    assert (evaluation.verdict.level, evaluation.verdict.findings) == (Level.GOOD, ())
    assert asdict(evaluation.figures.verdict) == {
        "level": "good",
        "text": "good: nothing contradicts the body",
        "findings": [],
    }


def test_the_verdict_of_the_replay_is_repeated(solved: Path) -> None:
    missed = Verdict.from_findings([Finding("torso", Level.DOUBTFUL, "was seen too rarely", part="segment")])
    stored = replace(read_solved(solved), stored_verdict=parse_verdict(verdict_text(missed)))
    assert solved_verdict(stored, {}) == missed


def test_a_camera_far_from_where_the_body_has_it_makes_a_result_wrong(walk: Walk, tmp_path: Path) -> None:
    elsewhere = walk.body.mounts["shin"].segment_T_camera @ rigid(np.eye(3), np.array([0.0, 0.4, 0.0]))
    body = replace(walk.body, mounts={**walk.body.mounts, "shin": CameraMount("shin_left", elsewhere)})
    evaluation = evaluate(write_solved(walk, tmp_path / "out", published=body))
    assert evaluation.verdict.level == Level.WRONG
    write_report(evaluation, tmp_path / "report")
    finding = evaluation.figures.verdict.findings[0]
    assert (finding["subject"], finding["level"]) == ("shin", "wrong")


@pytest.mark.parametrize("level", [Level.DOUBTFUL, Level.WRONG])
def test_the_line_in_the_picture_names_camera_and_cause_and_is_not_too_long(level: Level) -> None:
    short = Verdict.from_findings([Finding("head", level, "is odd", "its lens is wrong")])
    assert verdict_line(short).startswith(level.word)
    assert verdict_line(short).endswith("head (head: its lens is wrong)")
    many = Verdict.from_findings(
        [Finding(f"camera_{number}", level, "is odd", "its lens is wrong") for number in range(40)]
    )
    assert len(verdict_line(many)) == 150
