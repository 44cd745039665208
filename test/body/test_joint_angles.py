from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint import Joint
from bodycam_ros.body.joint_angles import EulerOrder, JointAngles, JointAngleTracker, SeenLimits
from bodycam_ros.geometry import exp_se3, exp_so3, log_so3

ORDERS = tuple("".join(order) for order in permutations("xyz"))


def test_names_follow_the_tree_and_the_order_of_axes(body: BodyModel) -> None:
    cart = ("cart_at_x", "cart_at_y", "cart_at_z", "cart_z", "cart_x", "cart_y")
    names = ("hip_y", "hip_z", "hip_x", "knee", "ankle_y", "ankle_x", "ankle_z", "axle", *cart, "wheel_axle")
    assert JointAngles(body).names == JointAngleTracker(body).names == names


def test_a_long_motion_with_whole_turns_is_followed(body: BodyModel, random: np.random.Generator) -> None:
    """A cranked axle and a swung arm pass pi again and again; the angles must neither jump nor lose a turn."""
    time = np.linspace(0.0, 6.0, 181)
    joint_angles = JointAngles(body)
    speed = np.where(
        np.isin(joint_angles.names, ("axle", "hip_y", "knee", "cart_at_x", "cart_z", "wheel_axle")), 5.0, 0.0
    )
    swing = np.where(speed > 0, 0.3, 1.2) * np.sin(np.outer(time, random.uniform(0.5, 2.0, len(speed))))
    truth = np.outer(time, speed) + swing
    world_T_root = exp_se3(np.outer(time, random.normal(size=6)))
    world_T_segment = body.forward_kinematics(world_T_root, joint_angles.poses(truth))
    tracker = JointAngleTracker(body)
    found = np.array([tracker.angles(poses) for poses in world_T_segment])
    np.testing.assert_allclose(found, truth, atol=1e-9)
    tracker.reset()
    again = tracker.angles(world_T_segment[-1])
    places = np.char.find(joint_angles.names, "_at_") >= 0
    turns = ((again - truth[-1]) / (2 * np.pi))[~places]
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    assert np.abs(again[~places]).max() <= np.pi + 1e-9
    np.testing.assert_allclose(again[places], truth[-1][places], atol=1e-9)


def test_what_it_returns_is_not_its_memory(body: BodyModel) -> None:
    tracker = JointAngleTracker(body)
    still = body.forward_kinematics(np.eye(4), JointAngles(body).poses(np.full(len(tracker.names), 0.3)))
    tracker.angles(still)[:] = 100.0
    np.testing.assert_allclose(tracker.angles(still), 0.3, atol=1e-12)


def test_rotations_alone_leave_a_free_joint_where_it_was(body: BodyModel, random: np.random.Generator) -> None:
    joint_angles = JointAngles(body)
    truth = random.uniform(-0.7, 0.7, size=len(joint_angles.names))
    np.testing.assert_allclose(joint_angles.angles(joint_angles.rotations(truth), truth), truth, atol=1e-12)
    elsewhere = joint_angles.angles(joint_angles.rotations(truth), truth + 0.1)
    at = joint_angles.names.index("cart_at_x")
    np.testing.assert_allclose(np.flatnonzero(np.abs(elsewhere - truth) > 0.01), [at, at + 1, at + 2])


def test_only_joints_with_limits_give_way(body: BodyModel) -> None:
    knee = next(joint for joint in body.joints if joint.name == "knee")
    limited = replace(body, joints=(replace(knee, limits=((-0.1, 2.5),)), *(j for j in body.joints if j is not knee)))
    limits = SeenLimits(limited)
    names = JointAngles(limited).names
    assert not limits.widen(np.array([100.0 if name != "knee" else 1.0 for name in names]))
    assert limits.widen(np.array([100.0 if name != "knee" else 3.0 for name in names]))
    assert {joint.name for joint in limits.body.joints if joint.limits} == {"knee"}


def test_a_body_of_welds_has_no_angles() -> None:
    stool = BodyModel("stool", "foot", ("foot", "seat"), (Joint("post", "foot", "seat", "weld", np.eye(4)),), {})
    assert JointAngleTracker(stool).angles(np.tile(np.eye(4), (2, 1, 1))).shape == (0,)
    assert JointAngles(stool).rotations(np.empty(0)).shape == (1, 3, 3)


def test_compose_is_scipys_intrinsic_sequence(random: np.random.Generator) -> None:
    angles = random.uniform(-7.0, 7.0, size=(4, 6, 3))
    ours = EulerOrder(ORDERS).compose(angles)
    for column, order in enumerate(ORDERS):
        theirs = Rotation.from_euler(order.upper(), angles[:, column]).as_matrix()
        np.testing.assert_allclose(ours[:, column], theirs, atol=1e-13)


def test_decompose_is_scipys_in_its_range(random: np.random.Generator) -> None:
    for rotation in Rotation.random(50, random_state=3):
        theirs = np.array([rotation.as_euler(order.upper()) for order in ORDERS])
        ours = EulerOrder(ORDERS).decompose(
            np.tile(rotation.as_matrix(), (6, 1, 1)), theirs + random.uniform(-0.1, 0.1, (6, 3))
        )
        np.testing.assert_allclose(ours, theirs, atol=1e-10)


def test_angles_stay_near_the_previous_ones_over_turns_and_triples(random: np.random.Generator) -> None:
    angles = random.uniform(-9.0, 9.0, size=(300, 6, 3))
    order = EulerOrder(ORDERS)
    for truth in angles:
        found = order.decompose(order.compose(truth), truth + random.uniform(-0.3, 0.3, size=(6, 3)))
        if np.abs(np.cos(truth[:, 1])).min() < 0.3:
            continue  # near the singularity the other triple may rightly be nearer
        np.testing.assert_allclose(found, truth, atol=1e-9)


@pytest.mark.parametrize("order", ORDERS)
def test_a_swing_through_the_singularity_is_continuous(order: str) -> None:
    """The middle angle passes 90 degrees and comes back; exactly there the first angle is not determined."""
    middle = np.concatenate([np.linspace(0.0, np.pi, 181), np.linspace(np.pi, 0.0, 181)])
    truth = np.stack([np.full(362, 0.4), middle, np.full(362, -0.7)], axis=-1)
    euler = EulerOrder((order,))
    previous = truth[:1]
    for wanted in truth:
        found = euler.decompose(euler.compose(wanted[None]), previous)
        np.testing.assert_allclose(found[0], wanted, atol=2e-4)
        previous = found


def test_noise_at_the_singularity_costs_no_rotation_and_makes_no_jump(random: np.random.Generator) -> None:
    euler = EulerOrder(("yzx",))
    still = np.array([[0.4, np.pi / 2, -0.7]])
    previous = still
    for _ in range(200):
        rotation = euler.compose(still) @ exp_so3(random.normal(scale=2e-5, size=(1, 3)))
        found = euler.decompose(rotation, previous)
        assert np.linalg.norm(log_so3(rotation[0].T @ euler.compose(found)[0])) < 2e-4
        assert np.abs(found - previous).max() < 1e-3
        previous = found


def test_no_rotations_have_no_angles() -> None:
    assert EulerOrder(()).decompose(np.empty((0, 3, 3)), np.empty((0, 3))).shape == (0, 3)
    assert EulerOrder(()).compose(np.empty((5, 0, 3))).shape == (5, 0, 3, 3)
