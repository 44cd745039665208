from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bodycam_ros.body.euler_angles import EulerOrder
from bodycam_ros.geometry import exp_so3, log_so3

ORDERS = tuple("".join(order) for order in permutations("xyz"))


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
