"""Loops closed from the N-pose, the equipment moved to the body first; loops that cannot be closed together.

Several starts, robust by graduated non-convexity (Yang et al. 2020): an attachment that conflicts with others is
released rather than met half-way.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.mechanism import Configuration, Mechanism
from bodycam_ros.geometry import Array, exp_so3
from bodycam_ros.kinematics.tangent import joint_gap
from bodycam_ros.least_squares import damped_gauss_newton

_CLOSED_SIGMAS = 3.0  # a loop that is strained less is closed
_GIVEN_M = 1e-3  # a given length is right to a millimetre
_BEYOND_RAD = np.radians(10.0) / _CLOSED_SIGMAS  # sigma of a joint's limits: nobody is bent farther than 10 deg beyond
_WEAK = 0.03  # of a loop that is only to come near: enough to stretch an arm, too little to tear a foot off
_STEPS, _STEPS_TO_THE_END, _KEPT_STARTS = 6, 60, 2
_ANNEALING = 0.2
_LONGEST_STEP = 0.6  # [rad], or of a limb's length
_ENOUGH = 1e-5  # relative decrease of the cost
_EXACT = 1e-20  # [sigma^2] cost of closed loops: places are right to 1e-14 m
_BENT = 0.6  # of the way to the middle of its limits: a straight knee has no direction in which to bend
_QUARTERS = (0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi)


@dataclass(frozen=True)
class Contradiction:
    """A loop that does not close.

    Attributes:
        name: of the attachment, or of the body's own joint.
        apart_m: how near its points come to each other at best, the worst of them, while all others hold [m].
        turned_rad: by how much it is turned from what it permits then [rad].
        against: loops any one of which, given up, would let it close.
    """

    name: str
    apart_m: float
    turned_rad: float
    against: tuple[str, ...]


def closed_configuration(mechanism: Mechanism) -> tuple[Configuration, tuple[Contradiction, ...]]:
    """A configuration that closes as many loops as can be closed together, and the loops that it leaves open."""
    configuration = _closed(mechanism, _starts(mechanism))
    left_open = _open(mechanism, configuration)
    for name in sorted(left_open, key=lambda name: _apart(mechanism, configuration, name)[0]):
        tried = _solve(mechanism, configuration, without=left_open - {name})[0]
        if _open(mechanism, tried) <= left_open - {name}:
            left_open, configuration = left_open - {name}, tried
    if not left_open:
        return configuration, ()
    configuration = _closed(mechanism, [configuration], left_open)
    left_open |= _open(mechanism, configuration)
    stretched = _solve(mechanism, configuration, weak=left_open)[0]
    found = []
    for name in sorted(left_open):
        against = []
        for other in sorted(set(mechanism.loops) - left_open, key=list(mechanism.loops).index):
            without = (left_open - {name}) | {other}
            if _open(mechanism, _solve(mechanism, stretched, without=without)[0]) <= without:
                against.append(other)
        found.append(Contradiction(name, *_apart(mechanism, stretched, name), tuple(against)))
    return configuration, tuple(found)


def projected(
    mechanism: Mechanism,
    start: Configuration,
    columns: NDArray[np.intp],
    without: Collection[str] = (),
    ground: Array | None = None,
) -> Configuration:
    """The configuration near another that closes all loops but some, to rounding if the chosen columns can."""

    def linearise(configuration: Configuration) -> tuple[Array, Array, float]:
        rows = mechanism.constraints(configuration, without, ground)
        return rows.residuals, rows.jacobian, float(rows.residuals @ rows.residuals)

    return _descended(mechanism, start, linearise, columns, _STEPS_TO_THE_END, 0.0, _EXACT)[0]


def _solve(
    mechanism: Mechanism,
    start: Configuration,
    columns: NDArray[np.intp] | None = None,
    without: Collection[str] = (),
    weak: Collection[str] = (),
    kernel: float = np.inf,
    steps: int = _STEPS_TO_THE_END,
) -> tuple[Configuration, float]:
    """Loops closed but some, others only near, joints within limits, lengths and posture near what is given.

    A loop whose rows are ``kernel`` sigmas off in all counts half (Geman-McClure).
    """

    def linearise(configuration: Configuration) -> tuple[Array, Array, float]:
        rows = mechanism.constraints(configuration, without)
        expected, by_expected = mechanism.expectations(configuration)
        owners = np.array(rows.owners)
        weights, cost = np.ones(len(owners)), float(expected @ expected)
        for name in mechanism.loops:
            own = owners == name
            square, counts = float(np.sum(rows.residuals[own] ** 2)), _WEAK**2 if name in weak else 1.0
            share = 1.0 if np.isinf(kernel) else kernel**2 / (kernel**2 + square)
            weights[own] = np.sqrt(counts) * share
            cost += counts * square * share
        J = np.vstack([weights[:, None] * rows.jacobian, by_expected])
        return np.concatenate([weights * rows.residuals, expected]), J, cost

    chosen = np.arange(mechanism.tangent.count) if columns is None else columns
    return _descended(mechanism, start, linearise, chosen, steps, _ENOUGH)


def _descended(
    mechanism: Mechanism,
    start: Configuration,
    linearise: Callable[[Configuration], tuple[Array, Array, float]],
    columns: NDArray[np.intp],
    steps: int,
    enough: float,
    solved: float = 0.0,
) -> tuple[Configuration, float]:
    units = mechanism.units[columns]

    def moved(configuration: Configuration, step: Array) -> Configuration:
        every = np.zeros(mechanism.tangent.count)
        every[columns] = units * step
        return mechanism.moved(configuration, every)

    def in_units(configuration: Configuration) -> tuple[Array, Array, float]:
        residuals, J, cost = linearise(configuration)
        return residuals, J[:, columns] * units, cost

    return damped_gauss_newton(start, in_units, moved, steps, _LONGEST_STEP, enough, solved)


def _starts(mechanism: Mechanism) -> list[Configuration]:
    """The N-pose, a little bent, with the equipment where the attachments want it: the best of several starts."""
    start, equipment = mechanism.resting(_BENT), mechanism.equipment
    if equipment is None:
        return [start]
    hinges = [joint for joint in equipment.joints if joint.type == "hinge"]
    own = mechanism.columns("place", "joint", names=[equipment.name, *(joint.name for joint in equipment.joints)])
    found = []
    for heading, angle in product(_QUARTERS, _QUARTERS if hinges else (0.0,)):
        motion = start.joint_motion.copy()
        motion[mechanism.tree.joint_row[equipment.name], :3, :3] = exp_so3(np.array([0.0, 0.0, heading]))
        for joint in hinges:
            motion[mechanism.tree.joint_row[joint.name], :3, :3] = joint.hinge_rotation(np.array(angle))
        found.append(_solve(mechanism, replace(start, joint_motion=motion), own, steps=2 * _STEPS))
    return [configuration for configuration, _ in sorted(found, key=lambda pair: pair[1])[:_KEPT_STARTS]]


def _closed(mechanism: Mechanism, starts: list[Configuration], without: Collection[str] = ()) -> Configuration:
    """The configuration that closes the most loops, from the best of some starts."""
    # A person sits on a bicycle in the posture that bends the least.
    best = min((_solve(mechanism, start, without=without) for start in starts), key=lambda pair: pair[1])[0]
    if _open(mechanism, best) <= set(without):
        return best
    annealed = []
    for start in (starts[0], best):
        configuration, kernel = start, max(_strains(mechanism, start).values(), default=0.0)
        while kernel > _CLOSED_SIGMAS:
            configuration = _solve(mechanism, configuration, without=without, kernel=kernel, steps=_STEPS)[0]
            kernel *= _ANNEALING
        annealed.append(_solve(mechanism, configuration, without=without, kernel=_CLOSED_SIGMAS)[0])
    return min(annealed, key=lambda configuration: len(_open(mechanism, configuration) - set(without)))


def _open(mechanism: Mechanism, configuration: Configuration) -> set[str]:
    return {name for name, strain in _strains(mechanism, configuration).items() if strain > _CLOSED_SIGMAS}


def _strains(mechanism: Mechanism, configuration: Configuration) -> dict[str, float]:
    """Loop -> what it takes to close it, in sigmas.

    The root of three squares: of its worst row, of the unknown length in it that is farthest from what is given, and of
    the joint in it that is farthest beyond its limits. Together, because a place a little too far away is reached a
    little in each of these ways.
    """
    tree, rows = mechanism.tree, mechanism.constraints(configuration)
    owners, joint_rows = np.array(rows.owners), mechanism.limits.angles.joint_rows
    longer, bent = np.zeros(len(tree.tree_joints)), np.zeros(len(tree.tree_joints))
    for name, by in mechanism.longer_by(configuration).items():
        longer[tree.joint_row[name]] = np.abs(by / np.maximum(mechanism.lengths[name], _GIVEN_M)).max()
    excess = mechanism.limits.excess(mechanism.limits.nearest_angles(configuration.joint_motion))
    np.maximum.at(bent, joint_rows, np.abs(excess) / _BEYOND_RAD)
    strains = {}
    for name, joint in mechanism.loops.items():
        through = tree.moves[tree.segment_index[joint.parent]] ^ tree.moves[tree.segment_index[joint.child]]
        worst = np.abs(rows.residuals[owners == name]).max(initial=0.0)
        strains[name] = float(np.linalg.norm([worst, *np.max([longer[through], bent[through]], axis=1, initial=0.0)]))
    return strains


def _apart(mechanism: Mechanism, configuration: Configuration, name: str) -> tuple[float, float]:
    """How far a loop is open: [m], the worst of an attachment's points, and [rad]."""
    joint, poses, index = mechanism.loops[name], mechanism.poses(configuration), mechanism.tree.segment_index
    parent, child = poses[index[joint.parent]], poses[index[joint.child]]
    gap = joint_gap(joint, parent, child)
    attachments = () if mechanism.equipment is None else mechanism.equipment.attachments
    points = [attachment.distances(child, parent).max() for attachment in attachments if attachment.name == name]
    return float(points[0] if points else np.linalg.norm(gap[3:])), float(np.linalg.norm(gap[:3]))
