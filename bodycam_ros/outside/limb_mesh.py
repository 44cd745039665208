"""A limb as one closed mesh: balls along a line, and the cones that touch neighbouring ones around it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.outside.closed_surface import Faces

_AROUND = 24  # vertices of each ring
_OVER_CAP = 6  # rings from the pole of a ball to its girth
_LONGEST_M = 0.05  # between two rings
_SHORTEST = 1e-3  # of the limb's length between two rings
_PARALLEL = 1e-6
_CIRCUMSCRIBED = (np.pi / _AROUND) / np.sin(np.pi / _AROUND)
"""Of the rings' radii: by Cauchy's formula a polygon of this size is, over all directions, as wide as the circle."""


@dataclass(frozen=True)
class Ball:
    """One of the balls that a limb is drawn around.

    Attributes:
        along: where on the line from the limb's start to its end; 0 to 1, the ends themselves.
        radius: [m]
        breadth: across the line and ``across``, in radii; 1 is round.
    """

    along: float
    radius: float
    breadth: float = 1.0


def limb_mesh(start: Array, end: Array, balls: Sequence[Ball], across: Array) -> tuple[Array, Faces]:
    """A closed mesh (V, 3) [m], (F, 3), outward, around balls along a line.

    Its mean width, over all directions around the line, is that of the limb.

    Args:
        start, end: (3,) of the line [m]; they differ.
        balls: in their order along the line.
        across: (3,) direction in which limbs that are not round are broader; made perpendicular to the line.
    """
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length
    if np.linalg.norm(np.cross(across, axis)) < _PARALLEL:
        across = np.eye(3)[np.abs(axis).argmin()]
    broad = across - (across @ axis) * axis
    broad = broad / np.linalg.norm(broad)
    rest = np.cross(axis, broad)

    at = np.array([ball.along * length for ball in balls])
    radii = np.array([ball.radius for ball in balls])
    rings = _rings(at, radii)
    radius = _profile(rings, at, radii) * _CIRCUMSCRIBED
    breadth = np.interp(rings, at, [ball.breadth for ball in balls])
    angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    circle = (radius * breadth)[1:-1, None, None] * np.cos(angle)[:, None] * broad
    circle = circle + radius[1:-1, None, None] * np.sin(angle)[:, None] * rest
    centres = start + rings[:, None] * axis
    vertices = np.concatenate([centres[:1], (centres[1:-1, None] + circle).reshape(-1, 3), centres[-1:]])
    return vertices, _faces(len(rings) - 2)


def _rings(at: Array, radii: Array) -> Array:
    """(R) places of the rings along the line, from pole to pole."""
    first, last = int(np.argmin(at - radii)), int(np.argmax(at + radii))
    low, high = at[first] - radii[first], at[last] + radii[last]
    cap = 1.0 - np.cos(0.5 * np.pi * np.arange(_OVER_CAP + 1) / _OVER_CAP)
    places = np.concatenate([low + radii[first] * cap, high - radii[last] * cap, *_touching(at, radii)])
    places = np.unique(places[(places >= low) & (places <= high)])
    kept = [low]
    for place in places[1:]:
        if place - kept[-1] > _SHORTEST * (high - low):
            steps = int(np.ceil((place - kept[-1]) / _LONGEST_M))
            kept += list(np.linspace(kept[-1], place, steps + 1)[1:])
    kept[-1] = high
    return np.array(kept)


def _touching(at: Array, radii: Array) -> list[Array]:
    """(2,) of each two neighbouring balls: where along the line the cone around them touches them."""
    touching = []
    for (x, y), (p, q) in zip(pairwise(at), pairwise(radii), strict=True):
        if abs(p - q) < y - x:  # else one is within the other
            sine = (p - q) / (y - x)
            touching.append(np.array([x + p * sine, y + q * sine]))
    return touching


def _profile(places: Array, at: Array, radii: Array) -> Array:
    """Radii of the limb at places along the line: the largest of its balls and cones."""
    square = radii**2 - (places[:, None] - at) ** 2
    radius: Array = np.sqrt(np.maximum(square, 0.0).max(axis=1))
    for touching in _touching(at, radii):
        ends = np.sqrt(np.maximum(radii**2 - (touching[:, None] - at) ** 2, 0.0).max(axis=1))
        within = (places >= touching[0]) & (places <= touching[1])
        radius = np.where(within, np.maximum(radius, np.interp(places, touching, ends)), radius)
    return radius


def _faces(rings: int) -> Faces:
    """Two triangles between neighbours on neighbouring rings, a fan at each pole."""
    ring = np.arange(_AROUND)
    following = (ring + 1) % _AROUND
    first, last = 1, 1 + (rings - 1) * _AROUND
    rows = 1 + np.arange(rings - 1)[:, None] * _AROUND
    a, b = (rows + ring).ravel(), (rows + following).ravel()
    c, d = a + _AROUND, b + _AROUND
    return np.concatenate(
        [
            np.stack([np.zeros_like(ring), first + following, first + ring], axis=1),
            np.stack([a, b, d], axis=1),
            np.stack([a, d, c], axis=1),
            np.stack([np.full_like(ring, last + _AROUND), last + ring, last + following], axis=1),
        ]
    ).astype(np.int32)
