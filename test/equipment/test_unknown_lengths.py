"""What nobody measured of a bicycle: its crank's length, on which side the pedal is, and where the bar is."""

import numpy as np
import pytest

from bodycam_ros.body.joint import Joint
from bodycam_ros.equipment.equipment import Attachment, Equipment, SegmentMotion
from bodycam_ros.equipment.unknown_lengths import UnknownLengths
from bodycam_ros.geometry import exp_so3, rigid

AXLE = Joint("axle", "frame", "crank", "hinge", np.eye(4))
SPINDLE_PLACE = rigid(exp_so3(np.array([0.0, 1.0, 0.0])), np.array([0.17, 0.12, 0.0]))
SPINDLE = Joint("spindle", "crank", "pedal", "hinge", SPINDLE_PLACE)
BAR = Attachment(
    "bar", "forearm", "frame", np.zeros((2, 3)), np.array([[0.4, 0.1, 0.7], [0.4, 0.3, 0.7]]), np.full(2, 0.05),
    unknown=np.array([0.15, 0.0, 0.1]),
)  # fmt: skip
SHOE = Attachment("shoe", "foot", "pedal", np.zeros((1, 3)), np.zeros((1, 3)), np.array([0.003]))


@pytest.fixture
def lengths() -> UnknownLengths:
    segments = dict.fromkeys(("frame", "crank", "pedal"), SegmentMotion())
    unknown = {"spindle": np.array([0.03, 0.02, 0.0])}
    return UnknownLengths(
        Equipment("bicycle", "frame", segments, (AXLE, SPINDLE), (BAR, SHOE), unknown), (AXLE, SPINDLE)
    )


def test_they_are_those_that_may_be_off(lengths: UnknownLengths) -> None:
    assert len(lengths) == 4
    assert lengths.names == ("bar_x", "bar_z", "spindle_x", "spindle_y")
    assert lengths.owners == (("bar", 0), ("bar", 2), ("spindle", 0), ("spindle", 1))
    np.testing.assert_array_equal(lengths.priors, [0.15, 0.1, 0.03, 0.02])


def test_a_hold_is_said_to_be_in_the_middle_of_its_points_and_a_joint_in_its_place(lengths: UnknownLengths) -> None:
    np.testing.assert_allclose(lengths.said, [0.4, 0.7, 0.17, 0.12])


def test_values_are_told_along_the_axes_of_their_owner(lengths: UnknownLengths) -> None:
    values = np.array([0.1, 0.2, 0.3, 0.4])
    np.testing.assert_array_equal(lengths.along_axes("bar", values), [0.1, 0.0, 0.2])
    np.testing.assert_array_equal(lengths.along_axes("spindle", values), [0.3, 0.4, 0.0])
    for known in ("shoe", "axle"):
        np.testing.assert_array_equal(lengths.along_axes(known, values), np.zeros(3))
        assert not lengths.of(known)


def test_a_hold_is_moved_as_one_in_the_axes_of_the_equipment(lengths: UnknownLengths) -> None:
    shifts = np.array([0.01, -0.02, 0.03, 0.04])
    moved = lengths.attachment(BAR, shifts)
    np.testing.assert_allclose(moved.on_equipment - BAR.on_equipment, [[0.01, 0.0, -0.02]] * 2)
    np.testing.assert_array_equal(moved.on_body, BAR.on_body)
    assert lengths.attachment(SHOE, shifts) is SHOE


def test_a_joint_is_moved_in_the_axes_of_its_parent_and_turns_as_before(lengths: UnknownLengths) -> None:
    before = SPINDLE.parent_T_joint.copy()
    moved = lengths.joint(SPINDLE, np.array([0.01, -0.02, 0.03, 0.04]))
    np.testing.assert_allclose(moved.parent_T_joint[:3, 3], [0.20, 0.16, 0.0])
    np.testing.assert_array_equal(moved.parent_T_joint[:3, :3], before[:3, :3])
    np.testing.assert_array_equal(SPINDLE.parent_T_joint, before)
    assert lengths.joint(AXLE, np.ones(4)) is AXLE


def test_of_equipment_that_is_measured_there_are_none() -> None:
    known = Equipment("board", "board", {"board": SegmentMotion()}, (), (SHOE,))
    lengths = UnknownLengths(known, ())
    assert len(lengths) == 0 and lengths.names == () and lengths.priors.shape == lengths.said.shape == (0,)
