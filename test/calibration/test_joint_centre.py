"""A eq. 12-14: a joint from the motion of its two segments."""

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.calibration.joint_centre import check_exercised, find_joint_centre
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import exp_so3, rigid

IN_PARENT, IN_CHILD = np.array([0.05, -0.21, 0.4]), np.array([-0.03, 0.07, 0.19])


def moving(turns: np.ndarray) -> np.ndarray:
    """parent_T_child (N, 4, 4) of a joint with rotation vectors (N, 3): A eq. 13 holds by construction."""
    R = exp_so3(np.array([0.3, -0.5, 0.9])) @ exp_so3(turns)
    return rigid(R, IN_PARENT - R @ IN_CHILD)


def ball_turns(count: int = 200, size: float = 0.5) -> np.ndarray:
    return size * np.sin(np.arange(count)[:, None] * np.array([0.11, 0.17, 0.29]))


def test_exact_ball() -> None:
    centre = find_joint_centre(moving(ball_turns()))
    np.testing.assert_allclose(centre.in_parent, IN_PARENT, atol=1e-9)
    np.testing.assert_allclose(centre.in_child, IN_CHILD, atol=1e-9)
    assert centre.freedoms == 3
    assert centre.residuals_m.max() < 1e-12


def test_the_null_vector_of_the_stacked_differences_is_the_same_joint() -> None:
    """A eq. 14 as it is printed: differences to the first instant, the right null vector by a plain SVD."""
    poses = moving(ball_turns())
    stacked = (poses[0] - poses[1:])[:, :3].reshape(-1, 4)
    null = np.linalg.svd(stacked)[2][-1]
    centre = find_joint_centre(poses)
    np.testing.assert_allclose(centre.in_child, null[:3] / null[3], atol=1e-9)


def test_a_fifth_of_wrong_registrations_hardly_moves_the_joint() -> None:
    random = np.random.default_rng(4)
    poses = moving(ball_turns(400))
    wrong = random.choice(400, 80, replace=False)
    poses[wrong] = rigid(exp_so3(random.normal(size=(80, 3))), random.normal(size=(80, 3)))
    centre = find_joint_centre(poses)
    np.testing.assert_allclose(centre.in_child, IN_CHILD, atol=2e-3)
    assert np.delete(centre.residuals_m, wrong).max() < 5e-3


@pytest.mark.parametrize(
    ("child", "turns", "named"),
    [
        ("shin_left", np.zeros((100, 3)), "knee_left"),
        ("head", np.zeros((100, 3)), "neck"),
        ("head", np.linspace(0, 1, 100)[:, None] * [0.0, 0.0, 1.0], "neck"),
    ],
)
def test_a_joint_that_was_not_exercised_is_named(child: str, turns: np.ndarray, named: str) -> None:
    centre = find_joint_centre(moving(turns))
    rig = Rig({"a": "trunk", "b": child}, {"trunk": None, child: "trunk"})
    with naming(RangeOfMotionError, named, SegmentName(child).exercise):
        check_exercised(rig, {child: centre})


def test_a_hinge_of_an_unknown_name_is_told_the_names_that_determine_it() -> None:
    centre = find_joint_centre(moving(np.linspace(0, 1, 100)[:, None] * [0.0, 1.0, 0.0]))
    rig = Rig({"a": "croup", "b": "gaskin"}, {"croup": None, "gaskin": "croup"})
    with naming(RangeOfMotionError, "gaskin", "shin_left", "forearm_right"):
        check_exercised(rig, {"gaskin": centre})
    assert check_exercised(Rig({"a": "t", "b": "shin_left"}, {"t": None, "shin_left": "t"}), {"shin_left": centre})
