"""Null motions in terms of joints: what a machine's joint takes along, and what moves on its own."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.mobility.mechanism import Freedom, Mechanism
from bodycam_ros.mobility.row_rank import null_space

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


@dataclass(frozen=True)
class MotionParts:
    """The null space in parts.

    Attributes:
        as_a_whole: freedoms that move everything in the world together.
        untouched: joints that no loop concerns -> their freedoms.
        led: what goes with each joint of the equipment.
        stuck: joints of the equipment that cannot move.
        others: how many freedoms there are besides.
        of_others: the joints, and the body's root, that have them.
    """

    as_a_whole: int
    untouched: Mapping[str, int]
    led: tuple[NullMotion, ...]
    stuck: tuple[str, ...]
    others: int
    of_others: tuple[str, ...]


def motion_parts(mechanism: Mechanism, unit: Array, free: Array) -> MotionParts:
    """Take a null space apart.

    Args:
        mechanism: body and equipment.
        unit: (R, K) unit rows.
        free: (K, F) orthonormal directions that they leave free.
    """
    equipment = mechanism.equipment
    own = [] if equipment is None else [joint.name for joint in equipment.joints]
    moving = [f for f in mechanism.freedoms if f.kind != "length" and _width(f)]
    joints = [f for f in moving if f.kind == "joint" or f.name in own]
    untouched = {f.name: _width(f) for f in joints if not np.any(unit[:, f.columns])}
    leading = [f for f in joints if f.name in own and f.name not in untouched]
    concerned = [f for f in moving if f.name not in untouched and f not in leading]
    root = mechanism.freedoms[0].columns
    together = null_space(unit[:, root])
    if together.shape[1] < 6 and equipment is not None:
        # Where the machine stands, its place beside the body is that of the body in the world.
        concerned = [f for f in concerned if f.name != equipment.name]
    whole = np.zeros((len(free), together.shape[1]))
    whole[root] = together
    led, stuck, rest = led_motions(_across(free, whole), leading, concerned)
    return MotionParts(
        as_a_whole=whole.shape[1],
        untouched=untouched,
        led=led,
        stuck=stuck,
        others=rest.shape[1] - sum(untouched.values()),
        of_others=tuple(f.name for f in concerned if np.linalg.norm(rest[f.columns]) > _MOVES),
    )


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
                rest = _across(rest, lead[:, None])
        if leads:
            groups = [group for group in (*leading, *others) if group is not freedom]
            motions.append(NullMotion(freedom.name, len(leads), _shares(np.stack(leads), groups)))
    return tuple(motions), tuple(stuck), rest


def _shares(leads: Array, groups: list[Freedom]) -> dict[str, float]:
    """How much groups move at most in some motions (M, K), those that do so noticeably."""
    shares = {group.name: float(np.linalg.norm(leads[:, group.columns], axis=1).max()) for group in groups}
    least = max(_NOTICED * max(shares.values(), default=0.0), _MOVES)
    return {name: share for name, share in sorted(shares.items(), key=lambda pair: -pair[1]) if share > least}


def _across(free: Array, directions: Array) -> Array:
    """Orthonormal directions of a space (K, F) across some of its own (K, N)."""
    across: Array = free @ null_space(directions.T @ free)
    return across


def _width(freedom: Freedom) -> int:
    return int(freedom.columns.stop - freedom.columns.start)
