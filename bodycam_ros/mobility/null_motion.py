"""Null motions in terms of joints: what a machine's joint takes along, and what moves on its own."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.mobility.mechanism import Freedom

_MOVES = 1e-6
_NOTICED = 0.02  # of the largest share: less is not worth a word


@dataclass(frozen=True)
class NullMotion:
    """A motion that keeps all loops closed.

    Attributes:
        joint: of the equipment, that leads it; one radian of it, or a limb's length, takes along
        with_joints: others -> how much they move, in radians or a limb's lengths, the most first.
    """

    joint: str
    with_joints: Mapping[str, float]


def led_motions(
    free: Array, leading: list[Freedom], others: list[Freedom]
) -> tuple[tuple[NullMotion, ...], tuple[str, ...], Array]:
    """The smallest motion for each leading freedom, the leading ones that cannot move, and what is free besides.

    Args:
        free: (K, F) orthonormal null space.
        leading: joints of the equipment.
        others: groups to be named.

    Returns:
        The motions, names of the leading that are stuck, and (K, F') orthonormal directions that move no leading one.
    """
    motions, stuck, rest = [], [], free
    for freedom in leading:
        part = free[freedom.columns]
        if np.linalg.norm(part) < _MOVES:
            stuck.append(freedom.name)
            continue
        for column in range(freedom.columns.start, freedom.columns.stop):
            lead = rest @ rest[column]
            if lead[column] < _MOVES:
                continue
            lead = lead / lead[column]
            shares = {other.name: float(np.linalg.norm(lead[other.columns])) for other in others + leading}
            del shares[freedom.name]
            most = max(shares.values(), default=0.0)
            named = sorted(shares.items(), key=lambda pair: -pair[1])
            kept = {name: share for name, share in named if share > max(_NOTICED * most, _MOVES)}
            motions.append(NullMotion(freedom.name, kept))
            rest = _without(rest, lead)
    return tuple(motions), tuple(stuck), rest


def _without(free: Array, direction: Array) -> Array:
    """Orthonormal directions of a space (K, F) across one of them (K)."""
    along = free.T @ direction
    _, _, Vt = np.linalg.svd(along[None])
    across: Array = free @ Vt[1:].T
    return across
