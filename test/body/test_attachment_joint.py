"""The point pairs of an attachment, summed up, are one joint, whose information is the Hessian of their squares."""

import numpy as np
import pytest
from helpers.closed_joint import closed_pose, joint_information

from bodycam_ros.body.equipment import Attachment, attachment_joint
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3, transform_points
from bodycam_ros.kinematics.joint import LOOSE_RAD

EQUIPMENT_T_BODY = exp_se3(np.array([0.7, -1.9, 0.4, 0.3, -0.2, 0.9]))
ONE = np.array([[0.12, 0.03, -0.08]])
TWO = np.array([[0.12, -0.04, -0.08], [0.10, 0.05, -0.06]])
LINE = ONE + np.array([-0.1, 0.02, 0.15])[:, None] * [[0.6, 0.0, 0.8]]
PLANE = np.array([[0.18, 0.04, -0.08], [0.18, -0.04, -0.08], [-0.05, 0.04, -0.08], [-0.05, -0.05, -0.08]])
SOLID = PLANE + [[0.0, 0.0, 0.1], [0.0, 0.0, 0.0], [0.0, 0.0, 0.02], [0.0, 0.0, 0.0]]
PLACES = {"one": ONE, "two": TWO, "line": LINE, "plane": PLANE, "solid": SOLID}


def attachment(on_body: Array, on_equipment: Array) -> Attachment:
    """Its points weigh differently."""
    sigmas = 0.003 * np.arange(1, len(on_body) + 1)
    return Attachment("hold", "foot", "pedal", on_body, on_equipment, sigmas)


def coinciding(on_body: Array) -> Attachment:
    return attachment(on_body, transform_points(EQUIPMENT_T_BODY, on_body))


def squares(held: Attachment, equipment_T_body: Array) -> float:
    """The weighted sum of squares of the distances, halved (B eq. 15)."""
    return 0.5 * float(np.sum((held.distances(equipment_T_body, np.eye(4)) / held.sigmas) ** 2))


def gradient(held: Attachment, equipment_T_body: Array, small: float = 1e-5) -> Array:
    """Its central differences along the tangents of the body's segment."""
    steps = small * np.eye(6)
    return np.array(
        [
            (squares(held, equipment_T_body @ exp_se3(step)) - squares(held, equipment_T_body @ exp_se3(-step)))
            / (2.0 * small)
            for step in steps
        ]
    )


@pytest.mark.parametrize("name", PLACES)
def test_information_is_the_hessian_of_the_pairs(name: str) -> None:
    """The Hessian of coinciding points is that of Gauss and Newton; a free turn has a sigma of 10 rad."""
    held = coinciding(PLACES[name])
    joint = attachment_joint(held)
    small = 1e-4
    hessian = np.array(
        [
            (gradient(held, EQUIPMENT_T_BODY @ exp_se3(step)) - gradient(held, EQUIPMENT_T_BODY @ exp_se3(-step)))
            / (2.0 * small)
            for step in small * np.eye(6)
        ]
    )
    largest = np.abs(hessian).max()
    np.testing.assert_allclose(joint_information(joint), hessian, atol=1e-5 * largest + LOOSE_RAD**-2)


@pytest.mark.parametrize("name", PLACES)
def test_far_from_holding_its_cost_is_theirs_to_second_order(name: str) -> None:
    held = coinciding(PLACES[name])
    joint = attachment_joint(held)
    for tangent in 0.01 * np.random.default_rng(3).standard_normal((5, 6)):
        equipment_T_body = EQUIPMENT_T_BODY @ exp_se3(tangent)
        measured = closed_pose(joint, equipment_T_body)
        off = log_se3(inverse(measured) @ equipment_T_body)
        assert 0.5 * off @ joint_information(joint) @ off == pytest.approx(squares(held, equipment_T_body), rel=0.03)
