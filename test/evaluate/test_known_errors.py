"""Errors that we made ourselves are found, each by its own measure and by no other."""

from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import FRAMES, Walk, write_solved, write_truth

from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.figures import TruthFigures
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.kinematics.joint import Joint

ROUNDING = 1e-6  # [cm], [deg]


def against(walk: Walk, truth: Path, folder: Path) -> TruthFigures:
    """The figures of an estimate against the truth."""
    figures = evaluate(write_solved(walk, folder / "out"), truth).figures.truth
    assert figures is not None
    return figures


def test_a_perfect_solution_has_no_error(walk: Walk, truth: Path, tmp_path: Path) -> None:
    figures = against(walk, truth, tmp_path)
    assert figures.coverage == 1.0
    assert figures.links_missing == []
    assert figures.scale == pytest.approx(1.0, abs=1e-9)
    assert figures.tilt_deg == pytest.approx(0.0, abs=1e-4)  # an arc cosine near 1 is coarse
    for measure in ("position_cm", "sim_position_cm", "angle_deg", "rotation_deg"):
        assert getattr(figures, measure).max < ROUNDING


def test_another_origin_and_heading_of_the_map_is_no_error_but_tilt_is(walk: Walk, truth: Path, tmp_path: Path) -> None:
    turn = exp_so3(np.array([0.0, 0.0, 2.0])) @ exp_so3(np.radians([3.0, 0.0, 0.0]))
    figures = against(walk.moved(rigid(turn, np.array([5.0, -3.0, 1.0]))), truth, tmp_path)
    assert figures.position_cm.max < ROUNDING
    assert figures.tilt_deg == pytest.approx(3.0, abs=ROUNDING)


def test_a_map_too_large_is_a_scale_error_that_a_similarity_takes_away(walk: Walk, truth: Path, tmp_path: Path) -> None:
    figures = against(larger(walk, 1.02), truth, tmp_path)
    assert figures.scale == pytest.approx(1.0 / 1.02, abs=1e-9)
    assert figures.sim_position_cm.max < ROUNDING
    # Of points spread by r about their mean, 2 % of r are missing.
    origins = walk.world_T_segment[..., :3, 3].reshape(-1, 3)
    radius_cm = 100.0 * np.linalg.norm(origins - origins.mean(axis=0), axis=1)
    assert figures.position_cm.mean == pytest.approx(0.02 * radius_cm.mean(), rel=1e-6)
    assert figures.rotation_deg.max < ROUNDING


def test_a_knee_that_bends_too_far_by_a_constant_is_a_matter_of_axes(walk: Walk, truth: Path, tmp_path: Path) -> None:
    figures = against(walk.bent("knee_left", np.full(FRAMES, 5.0)), truth, tmp_path)
    assert figures.angle_deg.max < ROUNDING
    assert figures.rotation_deg.max < 1e-4  # the alternating fit comes close
    assert figures.position_cm.max > 1.0


def test_a_knee_that_shakes_is_a_rotation_error_of_the_shin_alone(walk: Walk, truth: Path, tmp_path: Path) -> None:
    shaking = np.where(np.arange(FRAMES) % 2, 1.5, -1.5)
    per_joint = against(walk.bent("knee_left", shaking), truth, tmp_path).per_joint
    assert per_joint["shin_left"].rotation_deg.mean == pytest.approx(1.5, abs=1e-2)
    # The first frame is one of the errors, and all others are counted from it.
    assert per_joint["shin_left"].angle_deg.mean == pytest.approx(1.5, rel=0.03)
    for other in ("torso", "thigh_left", "foot_left"):
        assert per_joint[other].rotation_deg.max < ROUNDING
    shift_cm = per_joint["foot_left"].position_cm.mean
    assert shift_cm == pytest.approx(100.0 * 0.4 * np.radians(1.5), rel=0.2)


def test_a_wrong_first_frame_ruins_the_papers_angle_but_not_the_rotation(
    walk: Walk, truth: Path, tmp_path: Path
) -> None:
    slip = np.zeros(FRAMES)
    slip[0] = 8.0
    knee = against(walk.bent("knee_left", slip), truth, tmp_path).per_joint["shin_left"]
    assert knee.angle_deg.mean > 5.0
    assert knee.rotation_deg.mean < 0.5


def test_instants_that_were_not_solved_are_missing(walk: Walk, truth: Path, tmp_path: Path) -> None:
    evaluation = evaluate(write_solved(walk.without([0, 20, 21, 22]), tmp_path / "out"), truth)
    assert evaluation.comparison is not None
    assert evaluation.comparison.coverage == pytest.approx(1.0 - 4.0 / FRAMES)
    assert len(evaluation.comparison.stamps_ns) == FRAMES - 4


def test_truth_between_its_frames_is_interpolated(walk: Walk, truth: Path, tmp_path: Path) -> None:
    """Every other frame of the truth is left out: what lies between is off by the motion's curvature, no more."""
    sparse = write_truth(walk.without(list(range(1, FRAMES - 1, 2))), tmp_path / "sparse")
    figures = against(walk, sparse, tmp_path)
    assert figures.frames == FRAMES
    assert 0.0 < figures.position_cm.max < 0.1
    assert 0.0 < figures.rotation_deg.max < 0.3


def larger(walk: Walk, factor: float) -> Walk:
    """The walk of a body that is larger, in a map that is larger."""

    def stretched(joint: Joint) -> Joint:
        parent_T_joint = joint.parent_T_joint.copy()
        parent_T_joint[:3, 3] *= factor
        limits = {"limits": joint.limits} if joint.limits is not None else {}
        return Joint(
            joint.name, joint.parent, joint.child, joint.type, parent_T_joint, joint.child_T_joint,
            angle_axes=joint.angle_axes, axis=joint.axis, **limits,
        )  # fmt: skip

    poses = walk.world_T_segment.copy()
    poses[..., :3, 3] *= factor
    body = type(walk.body)(
        walk.body.name, walk.body.root, walk.body.segments, tuple(map(stretched, walk.body.joints)), walk.body.mounts
    )
    return Walk(body, walk.stamps_ns, poses)
