"""Null motions in terms of joints: what a machine's joint takes along, and what moves on its own."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.mobility.mechanism import Freedom

_MOVES = 1e-5
_NOTICED = 0.05  # of the largest share: less is not worth a word


@dataclass(frozen=True)
class NullMotion:
    """Motions that keep all loops closed, led by a joint of the equipment.

    Attributes:
        joint: that leads.
        freedoms: in how many ways.
        with_joints: others -> how much they move along at most, per radian, or a limb's length, of the joint; the most
            first.
    """

    joint: str
    freedoms: int
    with_joints: Mapping[str, float]


def led_motions(
    free: Array, leading: list[Freedom], others: list[Freedom]
) -> tuple[tuple[NullMotion, ...], tuple[str, ...], Array]:
    """The smallest motions that move the leading freedoms, one after the other.

    Args:
        free: (K, F) orthonormal null space.
        leading: joints of the equipment.
        others: groups to be named besides.

    Returns:
        The motions, names of the leading that cannot move, and (K, F') orthonormal directions that move none of them.
    """
    motions, stuck, rest = [], [], free
    for freedom in leading:
        if np.linalg.norm(free[freedom.columns]) < _MOVES:
            stuck.append(freedom.name)
        leads = []
        for column in range(freedom.columns.start, freedom.columns.stop):
            # The projection of a unit vector is the least motion with it; what is across of that leaves it alone.
            lead = rest @ rest[column]
            if lead[column] > _MOVES**2:
                leads.append(lead / np.linalg.norm(lead[freedom.columns]))
                rest = _without(rest, lead)
        if leads:
            groups = [group for group in (*leading, *others) if group is not freedom]
            motions.append(NullMotion(freedom.name, len(leads), _shares(np.stack(leads), groups)))
    return tuple(motions), tuple(stuck), rest


def _shares(leads: Array, groups: list[Freedom]) -> dict[str, float]:
    """How much groups move at most in some motions (M, K), those that do so noticeably."""
    shares = {group.name: float(np.linalg.norm(leads[:, group.columns], axis=1).max()) for group in groups}
    least = max(_NOTICED * max(shares.values(), default=0.0), _MOVES)
    return {name: share for name, share in sorted(shares.items(), key=lambda pair: -pair[1]) if share > least}


def _without(free: Array, direction: Array) -> Array:
    """Orthonormal directions of a space (K, F) across one of them (K)."""
    _, _, Vt = np.linalg.svd((free.T @ direction)[None])
    across: Array = free @ Vt[1:].T
    return across
