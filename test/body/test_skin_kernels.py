import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.body.skin_kernels import distance_to_limbs

Array = NDArray[np.float64]

CAPSULES = [
    (np.array([0.1, -0.2, 0.3]), np.array([0.0, 0.6, 0.8]), 0.4, 0.07),
    (np.array([0.1, -0.2, 0.3]), np.array([1.0, 0.0, 0.0]), 0.3, 0.05),
]
"""Start, direction, length and radius of limbs that begin at one joint and are perpendicular [m]."""


def fields(capsules: list[tuple[Array, Array, float, float]]) -> tuple[Array, Array, NDArray[np.int64]]:
    frames, balls, first = [], [], [0]
    for start, along, length, radius in capsules:
        broad = np.cross(along, [0.3, 0.5, -0.7])
        broad /= np.linalg.norm(broad)
        axes = np.stack([along, broad, np.cross(along, broad)])
        around = 0.5 * length + radius
        frames.append([*start, *axes.ravel(), *(start + 0.5 * length * along), around])
        at = np.linspace(0.0, length, 200)
        balls.append(np.column_stack([at, np.full((200, 3), radius)]))
        first.append(first[-1] + 200)
    return np.array(frames), np.concatenate(balls), np.array(first, np.int64)


def to_capsule(points: Array, start: Array, along: Array, length: float, radius: float) -> Array:
    nearest = start + np.clip((points - start) @ along, 0.0, length)[:, None] * along
    return np.linalg.norm(points - nearest, axis=1) - radius


def near(random: np.random.Generator) -> Array:
    """Points within the limbs, or less than 4 cm from them."""
    points = CAPSULES[0][0] + random.uniform(-0.15, 0.15, size=(1000, 3))
    away = np.minimum(*(to_capsule(points, *capsule) for capsule in CAPSULES))
    return np.asarray(points[away < 0.04])


def distances(points: Array, capsules: list[tuple[Array, Array, float, float]], k: float) -> Array:
    given = fields(capsules)
    return np.array([distance_to_limbs(*point, *given, k) for point in points])


def test_a_round_limb_is_as_far_as_its_axis_less_its_radius(random: np.random.Generator) -> None:
    points = near(random)
    exact = to_capsule(points, *CAPSULES[0])
    points, exact = points[exact < 0.04], exact[exact < 0.04]
    np.testing.assert_allclose(distances(points, CAPSULES[:1], 0.08), exact, rtol=0.0, atol=1e-4)


def test_far_away_it_is_a_lower_bound(random: np.random.Generator) -> None:
    points = random.uniform(-3.0, 3.0, size=(300, 3))
    ours, exact = distances(points, CAPSULES[:1], 0.08), to_capsule(points, *CAPSULES[0])
    assert (ours <= exact + 1e-4).all() and (ours[exact > 0.15] > 0.1).all()


def test_limbs_are_filleted_at_an_angle_and_nowhere_else(random: np.random.Generator) -> None:
    points, k = near(random), 0.08
    hard = np.minimum(*(to_capsule(points, *capsule) for capsule in CAPSULES))
    ours = distances(points, CAPSULES, k)
    added = hard - ours
    assert added.min() > -1e-4 and 0.2 * k < added.max() <= k / 4.0 + 1e-4
    # One limb twice, and one that the other continues, are as thick as one.
    start, along, length, radius = CAPSULES[0]
    further = (start + length * along, along, length, radius)
    for other in (CAPSULES[0], further):
        both = distances(points, [CAPSULES[0], other], k)
        alone = np.minimum(to_capsule(points, *CAPSULES[0]), to_capsule(points, *other))
        np.testing.assert_allclose(both[alone > -0.5 * radius], alone[alone > -0.5 * radius], rtol=0.0, atol=1e-3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_ellipsoid_s_surface_is_where_the_distance_is_zero(axis: int) -> None:
    half = np.array([0.05, 0.1, 0.2])
    frames = np.array([[*np.zeros(3), *np.eye(3).ravel(), *np.zeros(3), 0.2]])
    balls = np.array([[0.0, *half]])
    outward = np.eye(3)[axis]
    for off in (-0.002, 0.0, 0.002):
        point = (half[axis] + off) * outward
        found = distance_to_limbs(*point, frames, balls, np.array([0, 1]), 0.08)
        assert found == pytest.approx(off, abs=2e-4)
