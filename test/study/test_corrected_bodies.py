"""A body that somebody corrected by hand is not made anew without asking."""

from pathlib import Path

import pytest

from bodycam_ros.errors import StudyError
from bodycam_ros.study.corrected_bodies import CorrectedBodies
from bodycam_ros.study.study_steps import StudySteps
from bodycam_ros.workflow.step import Step, body_step, ingest_step, map_step


@pytest.fixture
def steps(tmp_path: Path) -> StudySteps:
    for name in ("photographs", "rom"):
        (tmp_path / name).mkdir()
    (tmp_path / "rig.yaml").write_text("rig")
    made = map_step("hall: map", tmp_path / "photographs", tmp_path / "map")
    bag = ingest_step("anna: ingest", tmp_path / "rom", tmp_path / "bag", None, None, None)
    body = body_step("anna: body", bag.output, made.output, tmp_path / "rig.yaml", tmp_path / "body.yaml", None)
    return StudySteps({"hall": [made]}, {"anna": [bag, body]}, {})


@pytest.fixture
def bodies(tmp_path: Path, steps: StudySteps) -> CorrectedBodies:
    bodies = CorrectedBodies(tmp_path / "study")
    bodies.check(steps)
    for name in ("map", "bag"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "made.yaml").write_text(name)
    (tmp_path / "body.yaml").write_text("body")
    for step in steps:
        bodies.note(step)
    return bodies


def the_body(steps: StudySteps) -> Step:
    return steps.of_subjects["anna"][-1]


def test_a_correction_stays_while_nothing_else_changes(bodies: CorrectedBodies, steps: StudySteps) -> None:
    the_body(steps).output.write_text("corrected")
    bodies.check(steps)


@pytest.mark.parametrize("changed", ["rig.yaml", "photographs/a.jpg", "rom/head.mp4"])
def test_it_is_not_replaced_when_what_it_was_made_of_changes(
    bodies: CorrectedBodies, steps: StudySteps, tmp_path: Path, changed: str
) -> None:
    (tmp_path / changed).write_text("another")
    bodies.check(steps)  # as it was made: it may be made again
    the_body(steps).output.write_text("corrected")
    with pytest.raises(StudyError, match=r"body\.yaml: was changed by hand, and what it was made of has changed"):
        bodies.check(steps)
    the_body(steps).output.unlink()
    bodies.check(steps)


def test_what_is_made_again_is_known_again(bodies: CorrectedBodies, steps: StudySteps, tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("another")
    the_body(steps).output.write_text("made of it")
    bodies.note(the_body(steps))
    bodies.check(steps)
