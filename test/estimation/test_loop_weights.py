"""Loops of a state: open, closed, and closed unless far apart."""

import numpy as np
import pytest

from bodycam_ros.estimation.estimate import Coordinates
from bodycam_ros.estimation.measurements import JointRotations, Measurements, SegmentPoses, StateFit
from bodycam_ros.kinematics.joint import LOOSE_M, Joint
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.kinematics.tree import KinematicTree


def normal_matrix(closed: dict[str, float], attachments: tuple[str, ...]) -> np.ndarray:
    """(K, K) of two segments that coincide, with two welds between them, from loops alone."""
    here, axis = np.eye(4), np.array([0.0, 0.0, 1.0])
    joints = [
        Joint(name, "parent", "child", kind, here, here, axis=axis)
        for name, kind in (("ball", "ball"), ("one", "weld"), ("other", "weld"))
    ]
    tangent = TreeTangent(KinematicTree("two", "parent", ("parent", "child"), tuple(joints)), LOOSE_M)
    at = Coordinates(tangent, np.tile(np.eye(4), (2, 1, 1)), np.zeros(tangent.count))
    nothing = SegmentPoses(np.zeros(0, np.int64), np.zeros((0, 4, 4)), np.zeros((0, 6, 6)))
    fit = StateFit(tangent, attachments)
    return fit._normal_equations(at, Measurements(nothing, JointRotations.nothing(), closed), True)[0]


@pytest.mark.parametrize("kernel", [4.0, np.inf])
def test_an_open_loop_without_a_gap_weighs_nothing(kernel: float) -> None:
    both = normal_matrix({}, ())
    assert np.isfinite(both).all() and both.any()
    np.testing.assert_allclose(normal_matrix({"one": kernel}, ("one", "other")), 0.5 * both)
    assert not normal_matrix({}, ("one", "other")).any()
