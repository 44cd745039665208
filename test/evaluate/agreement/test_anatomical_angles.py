"""Angles in the anatomical planes, of rotations and of centres of joints."""

import numpy as np
import pytest

from bodycam_ros.evaluate.agreement.anatomical_angles import angles_of_points, joint_name, planes_of
from bodycam_ros.geometry import exp_so3


def turned(axis: str, degrees: float) -> np.ndarray:
    return exp_so3(np.radians(degrees) * np.eye(3)["xyz".index(axis)])[None]


@pytest.mark.parametrize(
    ("segment", "axis", "degrees", "expected"),
    [
        ("thigh_left", "y", -30.0, (30.0, 0.0, 0.0)),  # the limb hangs down: forward is a negative turn about y
        ("shin_right", "y", 60.0, (60.0, 0.0, 0.0)),
        ("forearm_left", "y", -120.0, (120.0, 0.0, 0.0)),
        ("foot_left", "y", -10.0, (10.0, 0.0, 0.0)),
        ("upper_arm_left", "x", 95.0, (0.0, 95.0, 0.0)),
        ("upper_arm_right", "x", -95.0, (0.0, 95.0, 0.0)),
        ("thigh_left", "z", -20.0, (0.0, 0.0, 20.0)),
        ("thigh_right", "z", 20.0, (0.0, 0.0, 20.0)),
        ("torso", "y", 15.0, (15.0, 0.0, 0.0)),
        ("torso", "x", -15.0, (0.0, 15.0, 0.0)),
        ("head", "z", 40.0, (0.0, 0.0, 40.0)),
    ],
)
def test_a_turn_in_one_plane_is_told_in_it_alone(
    segment: str, axis: str, degrees: float, expected: tuple[float, ...]
) -> None:
    np.testing.assert_allclose(np.degrees(planes_of(segment, turned(axis, degrees))), [expected], atol=1e-6)


def test_a_twist_follows_the_limb() -> None:
    R = turned("x", 90.0) @ turned("z", -35.0)
    np.testing.assert_allclose(np.degrees(planes_of("upper_arm_left", R)), [(0.0, 90.0, 35.0)], atol=1e-6)


def test_centres_of_joints_tell_the_same_swing() -> None:
    """A person who faces any way, with the left arm raised to the side and the right knee bent."""
    facing = exp_so3(np.array([0.1, -0.2, 2.5]))
    local = {
        "thigh_left": (0.0, 0.1, 0.0), "thigh_right": (0.0, -0.1, 0.0),
        "upper_arm_left": (0.0, 0.2, 0.5), "upper_arm_right": (0.0, -0.2, 0.5),
        "forearm_left": (0.0, 0.2 + 0.3 * np.sin(1.2), 0.5 - 0.3 * np.cos(1.2)), "forearm_right": (0.0, -0.2, 0.2),
        "shin_left": (0.4 * np.sin(0.5), 0.1, -0.4 * np.cos(0.5)), "shin_right": (0.0, -0.1, -0.4),
        "foot_right": (-0.4 * np.sin(0.9), -0.1, -0.4 - 0.4 * np.cos(0.9)),
    }  # fmt: skip
    found = angles_of_points({name: (facing @ place)[None] + [1.0, 2.0, 3.0] for name, place in local.items()})
    np.testing.assert_allclose(found["upper_arm_left"], [[0.0, 1.2, np.nan]], atol=1e-9)
    np.testing.assert_allclose(found["thigh_left"], [[0.5, 0.0, np.nan]], atol=1e-9)
    np.testing.assert_allclose(found["shin_right"], [[0.9, np.nan, np.nan]], atol=1e-9)
    np.testing.assert_allclose(found["torso"], [[0.0, 0.0, 0.0]], atol=1e-9)
    assert "shin_left" not in found


def test_joints_have_names_that_people_know() -> None:
    assert [joint_name(s) for s in ("thigh_left", "forearm_right", "torso", "crank")] == [
        "hip left", "elbow right", "spine", "crank",
    ]  # fmt: skip
