"""The unknown lengths and girths of a body: what shares of them make, and what is expected of them beforehand."""

import numpy as np
import pytest

from bodycam_ros.body.average_person import body_of_height, stature_of
from bodycam_ros.body.body_model import THICKEST, THINNEST
from bodycam_ros.body.body_shape import BodyShape, ShapeSettings
from bodycam_ros.body.segment_name import mirrored


@pytest.fixture
def shape() -> BodyShape:
    return BodyShape(body_of_height(1.8, "person"), ShapeSettings())


def row(shape: BodyShape, name: str, axis: str = "") -> int:
    return shape.names.index((name, axis))


def test_no_change_makes_the_same_body(shape: BodyShape) -> None:
    body, same = body_of_height(1.8, "person"), shape.shaped(np.zeros(shape.size))
    for before, after in zip(body.joints, same.joints, strict=True):
        np.testing.assert_allclose(after.parent_T_joint, before.parent_T_joint, atol=1e-15)
    assert same.girths == dict.fromkeys(shape.thick, pytest.approx(1.0))


def test_a_share_lengthens_one_joint_along_one_axis(shape: BodyShape) -> None:
    shares = np.zeros(shape.size)
    shares[row(shape, "knee_left", "z")] = 0.1
    changed = {joint.name: joint for joint in shape.shaped(shares).joints}
    for joint in body_of_height(1.8, "person").joints:
        factor = 1.1 if joint.name == "knee_left" else 1.0
        expected = joint.parent_T_joint[:3, 3] * [1.0, 1.0, factor]
        np.testing.assert_allclose(changed[joint.name].parent_T_joint[:3, 3], expected, atol=1e-15)


def test_a_body_of_larger_bones_is_as_thick_in_metres(shape: BodyShape) -> None:
    """Girths are relative to people of the body's size; longer bones alone do not make it thicker."""
    shares = np.zeros(shape.size)
    shares[: len(shape.lengths)] = 0.25
    larger = shape.shaped(shares)
    assert stature_of(larger) == pytest.approx(1.25 * 1.8)
    np.testing.assert_allclose([*larger.girths.values()], 1.0 / 1.25)


def test_lengths_keep_their_sign_and_girths_their_limits(shape: BodyShape) -> None:
    thin = shape.shaped(np.full(shape.size, -5.0))
    for before, after in zip(body_of_height(1.8, "person").joints, thin.joints, strict=True):
        np.testing.assert_array_equal(np.sign(after.parent_T_joint[:3, 3]), np.sign(before.parent_T_joint[:3, 3]))
    thick = np.zeros(shape.size)
    thick[len(shape.lengths) :] = 50.0
    assert set(shape.shaped(thick).girths.values()) == {THICKEST}
    thick[len(shape.lengths) :] = -0.85
    assert set(shape.shaped(thick).girths.values()) == {THINNEST}


def cost(shape: BodyShape, shares: np.ndarray) -> float:
    """Half the sum of squares that the normal equations are of, up to its value at zero."""
    information, at_zero = shape.prior(np.zeros(shape.size))
    return float(0.5 * shares @ information @ shares - at_zero @ shares)


def test_the_prior_is_one_of_its_sigmas_at_one_sigma(shape: BodyShape) -> None:
    # The spine is in the middle, and has no partner.
    for name, axis, sigma in (("spine", "z", ShapeSettings().length_sigma), ("head", "", 0.08)):
        shares = np.zeros(shape.size)
        shares[row(shape, name, axis)] = sigma
        assert cost(shape, shares) == pytest.approx(0.5)


def test_the_normal_equations_are_about_the_shares_that_are_given(shape: BodyShape) -> None:
    """A Newton step from anywhere ends where the prior is least, as it is quadratic."""
    shares = np.random.default_rng(4).normal(0.0, 0.1, shape.size)
    information, right = shape.prior(shares)
    there = shares + np.linalg.solve(information, right)
    np.testing.assert_allclose(shape.prior(there)[1], 0.0, atol=1e-7)
    np.testing.assert_allclose(there, 0.0, atol=1e-9)


def test_what_differs_between_the_sides_costs_more_than_what_does_not(shape: BodyShape) -> None:
    sides = [
        (own, row(shape, partner, axis))
        for own, (name, axis) in enumerate(shape.names)
        if (partner := mirrored(name)) and own < row(shape, partner, axis)
    ]
    assert len(sides) > 10
    for own, other in sides:
        alike, apart = np.zeros(shape.size), np.zeros(shape.size)
        alike[[own, other]] = 0.02
        apart[[own, other]] = 0.02, -0.02
        assert cost(shape, apart) > 3.0 * cost(shape, alike)
