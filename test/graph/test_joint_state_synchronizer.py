"""Joint states and odometry of one stamp make a pose; what does not fit is named and dropped."""

import numpy as np
import pytest
from helpers.naming import names
from helpers.rider import rider_body

from bodycam_ros.geometry import Array, exp_se3
from bodycam_ros.graph.joint_state_synchronizer import _UNPAIRED, JointStateSynchronizer
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.messages.body import joint_state_message
from bodycam_ros.messages.factory import MAP_FRAME, Message, header_message
from bodycam_ros.messages.poses import pose_with_covariance_message
from bodycam_ros.recording.typestore import recorded_messages

BODY = rider_body()
NAMES = JointAngles(BODY).names
MAKE = recorded_messages()


def joint_state(stamp_ns: int, angles: dict[str, float]) -> Message:
    values = np.array(list(angles.values()))
    return joint_state_message(MAKE, stamp_ns, list(angles), values, np.zeros(len(values)))


def odometry(stamp_ns: int, world_T_root: Array) -> Message:
    pose = pose_with_covariance_message(MAKE, world_T_root, np.eye(6))
    header = header_message(MAKE, stamp_ns, MAP_FRAME)
    twist = MAKE("geometry_msgs/msg/TwistWithCovariance")
    return MAKE("nav_msgs/msg/Odometry", header=header, child_frame_id=BODY.root, pose=pose, twist=twist)


def angles_at(stamp_ns: int) -> dict[str, float]:
    return {name: 0.01 * row + 1e-3 * stamp_ns for row, name in enumerate(NAMES)}


def root_at(stamp_ns: int) -> Array:
    return exp_se3(np.array([0.1, 0.2, 0.3, 1.0, 2.0, 1e-3 * stamp_ns]))


class Synchronized:
    """A synchronizer with what came out of it."""

    def __init__(self) -> None:
        self.poses: list[tuple[int, Array, Array]] = []
        self.faults: list[str] = []
        self.of = JointStateSynchronizer(lambda *pose: self.poses.append(pose), self.faults.append)
        self.of.set_body(BODY)

    def add(self, stamp_ns: int) -> None:
        self.of.add_joint_state(joint_state(stamp_ns, angles_at(stamp_ns)))
        self.of.add_odometry(odometry(stamp_ns, root_at(stamp_ns)))

    @property
    def stamps(self) -> list[int]:
        return [stamp_ns for stamp_ns, _, _ in self.poses]


def test_messages_of_one_stamp_make_a_pose_in_whatever_order_they_come() -> None:
    both = Synchronized()
    both.of.add_joint_state(joint_state(1, angles_at(1)))
    both.of.add_odometry(odometry(2, root_at(2)))
    assert not both.poses
    both.of.add_joint_state(joint_state(2, dict(reversed(angles_at(2).items()))))
    both.of.add_odometry(odometry(1, root_at(1)))
    assert both.stamps == [2, 1] and not both.faults
    for stamp_ns, angles, world_T_root in both.poses:
        assert angles.tolist() == list(angles_at(stamp_ns).values()), "in the order of the body's angles"
        np.testing.assert_allclose(world_T_root, root_at(stamp_ns), atol=1e-12)


def test_joints_of_others_are_ignored_and_missing_ones_named() -> None:
    both = Synchronized()
    both.of.add_joint_state(joint_state(1, angles_at(1) | {"gripper": 0.5}))
    both.of.add_odometry(odometry(1, root_at(1)))
    assert both.stamps == [1] and not both.faults
    lacking = angles_at(2)
    del lacking[NAMES[3]]
    both.of.add_joint_state(joint_state(2, lacking))
    both.of.add_odometry(odometry(2, root_at(2)))
    assert both.stamps == [1]
    (fault,) = both.faults
    assert names(fault, NAMES[3]) and names(fault, "joint_states")


@pytest.mark.parametrize("wrong", ["angles", "root"])
def test_a_pose_that_is_not_finite_is_dropped_with_its_stamp(wrong: str) -> None:
    both = Synchronized()
    angles, root = angles_at(7), root_at(7)
    if wrong == "angles":
        angles[NAMES[0]] = np.nan
    else:
        root[0, 3] = np.inf
    both.of.add_joint_state(joint_state(7, angles))
    both.of.add_odometry(odometry(7, root))
    assert not both.poses and names(both.faults[0], "7 ns")
    both.add(8)
    assert both.stamps == [8]


def test_a_joint_state_without_positions_is_dropped() -> None:
    both = Synchronized()
    message = joint_state(1, angles_at(1))
    message.position = message.position[:-1]
    both.of.add_joint_state(message)
    both.of.add_odometry(odometry(1, root_at(1)))
    assert not both.poses and names(both.faults[0], "joint_states")


def test_messages_without_a_partner_are_bounded_the_oldest_go() -> None:
    both = Synchronized()
    for stamp_ns in range(1, _UNPAIRED + 3):
        both.of.add_joint_state(joint_state(stamp_ns, angles_at(stamp_ns)))
    for stamp_ns in range(1, _UNPAIRED + 3):
        both.of.add_odometry(odometry(stamp_ns, root_at(stamp_ns)))
    assert both.stamps == list(range(3, _UNPAIRED + 3)) and not both.faults


def test_another_body_and_time_that_went_back_drop_what_waits() -> None:
    both = Synchronized()
    for drop in (both.of.clear, lambda: both.of.set_body(BODY), lambda: both.of.set_body(None)):
        both.of.add_joint_state(joint_state(1, angles_at(1)))
        drop()
        both.of.add_odometry(odometry(1, root_at(1)))
        assert not both.poses
        both.of.clear()
    both.add(2)
    assert not both.poses and not both.faults, "there is no body"
    both.of.set_body(BODY)
    both.add(3)
    assert both.stamps == [3]
