from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.kinematics.joint import FULL_TURN
from bodycam_ros.kinematics.joint_angles import EulerOrder, JointAngles, JointAngleTracker

ORDERS = tuple("".join(order) for order in permutations("xyz"))


def test_a_long_motion_with_whole_turns_is_followed(body: BodyModel, random: np.random.Generator) -> None:
    """A cranked axle and a swung arm pass pi again and again; only a ball's angle drops a turn, at a full one."""
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
    swung = joint_angles.names.index("hip_y")
    assert np.abs(found[:, swung]).max() <= FULL_TURN < np.abs(truth[:, swung]).max()
    found[:, swung] = np.unwrap(found[:, swung])
    np.testing.assert_allclose(found, truth, atol=1e-9)
    tracker.reset()
    again = tracker.angles(world_T_segment[-1])
    places = np.char.find(joint_angles.names, "_at_") >= 0
    turns = ((again - truth[-1]) / (2 * np.pi))[~places]
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    assert np.abs(again[~places]).max() <= np.pi + 1e-9
    np.testing.assert_allclose(again[places], truth[-1][places], atol=1e-9)


def test_velocities_are_the_rates_of_the_angles(body: BodyModel, random: np.random.Generator) -> None:
    joint_angles = JointAngles(body)
    angles, rates = random.uniform(-0.6, 0.6, (2, len(joint_angles.names)))
    world_T_root, root_twist = exp_se3(random.normal(size=6)), random.normal(size=6)

    def poses(after_s: float) -> Array:
        return joint_angles.forward_kinematics(world_T_root @ exp_se3(after_s * root_twist), angles + after_s * rates)

    step_s = 1e-6
    twists = log_se3(inverse(poses(-step_s)) @ poses(step_s)) / (2.0 * step_s)
    np.testing.assert_allclose(joint_angles.velocities(poses(0.0), twists, angles), rates, atol=1e-7)


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


def test_all_instants_at_once_are_each_alone(body: BodyModel, random: np.random.Generator) -> None:
    joint_angles = JointAngles(body)
    truth = random.uniform(-7.0, 7.0, (5, len(joint_angles.names)))
    poses = joint_angles.poses(truth)
    found = joint_angles.angles(poses, truth + random.uniform(-0.1, 0.1, truth.shape))
    np.testing.assert_allclose(found, truth, atol=1e-9)
    alone = [joint_angles.angles(*each) for each in zip(poses, truth, strict=True)]
    np.testing.assert_allclose(found, alone, atol=1e-9)
