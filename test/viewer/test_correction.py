"""Corrections of a body: figures, and what is written."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from bodycam_ros.body.average_person import with_hands
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.viewer.correction import BodyFile, Correction, Move, Part, can_turn, place_of

EXACT_MM = 1e-9
KNEE, HIP, SHIN, FOOT = Part("joint", "knee"), Part("joint", "hip"), Part("camera", "shin"), Part("camera", "foot")
MOVE = Move(np.array([3.0, -4.0, 12.0]), np.array([1.0, 2.0, -2.0]))
SHIFT = Move(np.array([3.0, -4.0, 12.0]), np.zeros(3))


def moved_by(correction: Correction, part: Part, move: Move) -> Correction:
    """A part so far from where it is now, in the axes of the segment that carries it."""
    was = place_of(correction.body, part)[1]
    now = rigid(exp_so3(np.radians(move.turn_deg)) @ was[:3, :3], was[:3, 3] + 1e-3 * move.shift_mm)
    return correction.moved_to(part, now)


def assert_move(move: Move, expected: Move) -> None:
    assert_allclose(move.shift_mm, expected.shift_mm, rtol=0.0, atol=EXACT_MM)
    assert_allclose(move.turn_deg, expected.turn_deg, rtol=0.0, atol=EXACT_MM)


@pytest.mark.parametrize("part", [SHIN, FOOT, KNEE, HIP, Part("joint", "pedal")])
def test_a_part_is_where_it_was_moved_by(rider: BodyModel, part: Part) -> None:
    assert_move(moved_by(Correction(rider, rider), part, MOVE).move_of(part), MOVE)


def test_moves_are_in_the_axes_of_the_segment_that_carries_the_part(rider: BodyModel) -> None:
    segment, was = place_of(rider, SHIN)
    _, now = place_of(moved_by(Correction(rider, rider), SHIN, MOVE).body, SHIN)
    assert segment == "shin"
    assert_allclose(now[:3, 3] - was[:3, 3], MOVE.shift_mm * 1e-3, rtol=0.0, atol=1e-12)
    assert_allclose(now[:3, :3], exp_so3(np.radians(MOVE.turn_deg)) @ was[:3, :3], rtol=0.0, atol=1e-12)


def test_what_was_taken_along_has_not_moved(rider: BodyModel) -> None:
    correction = moved_by(moved_by(moved_by(Correction(rider, rider), HIP, SHIFT), KNEE, MOVE), SHIN, SHIFT)
    assert [part for part, _ in correction.moves()] == [SHIN, KNEE, HIP]  # cameras first, as in the file
    assert_move(correction.move_of(KNEE), MOVE)
    assert_move(correction.move_of(SHIN), SHIFT)
    assert correction.move_of(FOOT).is_none


def test_hands_that_are_shown_are_not_written(body_file: Path) -> None:
    file, before = BodyFile(body_file), body_file.read_bytes()
    read = file.read()
    shown, elbow = with_hands(read), Part("joint", "elbow_left")
    moved = moved_by(Correction(shown, shown), elbow, SHIFT)
    assert "hand_left" in file.write(moved).segments
    written = read_body(body_file)
    assert written.segments == read.segments and [j.name for j in written.joints] == [j.name for j in read.joints]
    assert_allclose(place_of(written, elbow)[1], place_of(moved.body, elbow)[1], rtol=0.0, atol=1e-6)
    assert file.original_path.read_bytes() == before


def test_ball_joints_do_not_turn(rider: BodyModel) -> None:
    assert can_turn(rider, SHIN) and can_turn(rider, KNEE)
    assert not can_turn(rider, HIP) and not can_turn(rider, None)
