"""Where a limb's two segments are, given where it begins and ends: what puts feet on pedals and hands on bars."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def two_links(
    start: Array, end: Array, upper: Array, lower: Array, bends_to: Array, left: float = 1.0
) -> tuple[Array, Array]:
    """Rotations (T, 3, 3) of the limb's two segments in the world.

    Args:
        start, end: (T, 3) hip and ankle, or shoulder and hand.
        upper, lower: (3) from each segment's origin to its end, in its own axes.
        bends_to: (T, 3) where knee or elbow go, roughly.
        left: 1 for a knee, -1 for an elbow: it bends the other way about the segments' y axes.
    """
    a, b = np.linalg.norm(upper), np.linalg.norm(lower)
    reach = np.linalg.norm(end - start, axis=-1, keepdims=True)
    assert (reach < a + b).all(), f"{reach.max():.3f} m is out of reach"
    along = (end - start) / reach
    aside = bends_to - np.sum(bends_to * along, axis=-1, keepdims=True) * along
    aside /= np.linalg.norm(aside, axis=-1, keepdims=True)
    before = (reach**2 + a**2 - b**2) / (2.0 * reach)
    middle = start + before * along + np.sqrt(a**2 - before**2) * aside
    y = left * np.cross(aside, along)
    return _pointing(middle - start, y, upper), _pointing(end - middle, y, lower)


def _pointing(direction: Array, y: Array, own: Array) -> Array:
    """Rotations (T, 3, 3) that bring a segment's own direction (3) to others (T, 3), its y axis near some (T, 3)."""
    turned: Array = _frame(direction, y) @ np.swapaxes(_frame(own, np.array([0.0, 1.0, 0.0])), -1, -2)
    return turned


def _frame(down: Array, y: Array) -> Array:
    z = -down / np.linalg.norm(down, axis=-1, keepdims=True)
    x = np.cross(y, z)
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)
