"""Degrees of freedom of a body with its equipment: count (B eq. 9), rank and null space of the constraints."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body.loop_closing import Contradiction, closed_configuration, projected
from bodycam_ros.body.mechanism import Configuration, Mechanism, Rows
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import GIVES_M, held_rows

_DEPENDENT = 1e-7  # singular value of unit rows: loops are closed to 1e-12, so dependent rows are so to rounding
_UNMOVED = 1e-10  # of the longest row: such a row is rounding
_COMPANION = 1e-3  # share of a row in a sum, below which it is not named
_MOVES = 1e-5  # in a null motion of length one
_NOTICED, _NOTICED_RAD = 0.05, np.radians(1.0)  # of the largest share of a null motion; beyond limits
_STEP, _STEPS, _PATHS = 0.12, 20, 3  # [rad], or of a limb's length, along null motions
_STILL_CLOSED = 1e-6  # [sigma]
_DIRECTIONS = ("forward", "sideways", "up")


@dataclass(frozen=True)
class GrueblerCount:
    """The numbers of B eq. 9.

    Attributes:
        links: N, the segments that may move.
        joints: name -> f, for all g joints; the free joint to a machine takes no freedom.
        leaning: what a machine that may not lean loses.
    """

    links: int
    joints: Mapping[str, int]
    leaning: int

    @property
    def freedoms(self) -> int:
        """F = 6 N - sum (6 - f)."""
        return 6 * self.links - sum(6 - f for f in self.joints.values()) - self.leaning


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


@dataclass(frozen=True)
class Mobility:
    """Mobility of a mechanism, where its loops are closed.

    Attributes:
        count: Gruebler's.
        rows: how many constraint rows there are.
        rank: how many of them are independent.
        rank_along: least and greatest along motions that keep the loops closed; None: nothing moves.
        freedoms: dimension of the null space.
        parts: what moves with what.
        redundant: row -> rows of which it is a sum.
        contradictions: loops that do not close; the rest is found without them.
        longer: unknown length -> by how much it is more than given (3), and the sigma (3) [m].
        beyond_limits: joint angle -> how far it is turned, and by how much too far [rad].
    """

    count: GrueblerCount
    rows: int
    rank: int
    rank_along: tuple[int, int] | None
    freedoms: int
    parts: MotionParts
    redundant: Mapping[str, tuple[str, ...]]
    contradictions: tuple[Contradiction, ...]
    longer: Mapping[str, tuple[Array, Array]]
    beyond_limits: Mapping[str, tuple[float, float]]


def mobility(body: BodyModel, equipment: Equipment | None = None) -> Mobility:
    """Count, close and move a mechanism.

    Raises:
        BodyError: the equipment does not fit the body.
    """
    mechanism = Mechanism(body, equipment)
    configuration, contradictions = closed_configuration(mechanism)
    apart = tuple(contradiction.name for contradiction in contradictions)
    moving = mechanism.columns("place", "joint")
    configuration = projected(mechanism, configuration, moving, apart)
    rows = mechanism.constraints(configuration, apart, mechanism.poses(configuration))
    unit = unit_rows(mechanism, rows)
    free = null_space(unit, moving)
    angles = mechanism.limits.nearest_angles(configuration.joint_motion)
    excess = mechanism.limits.excess(angles)
    longer = mechanism.longer_by(configuration)
    return Mobility(
        count=gruebler_count(mechanism),
        rows=len(unit),
        rank=rank(unit),
        rank_along=_rank_along(mechanism, configuration, apart, free),
        freedoms=free.shape[1],
        parts=motion_parts(mechanism, unit, free),
        redundant=redundant_rows(unit, _row_names(rows)),
        contradictions=contradictions,
        longer={name: (longer[name], sigma) for name, sigma in mechanism.lengths.items()},
        beyond_limits={
            mechanism.limits.angles.names[angle]: (float(angles[angle]), float(excess[angle]))
            for angle in np.flatnonzero(np.abs(excess) > _NOTICED_RAD)
        },
    )


def gruebler_count(mechanism: Mechanism) -> GrueblerCount:
    """Count segments and joints of the body with its equipment; what stands is the ground."""
    joints = {joint.name: len(joint.free_rows(GIVES_M)) for joint in mechanism.body.tree_joints}
    joints |= {joint.name: 6 - len(held_rows(joint)) for joint in mechanism.body.loop_joints}
    links = len(mechanism.body.segments) - len(mechanism.grounded)
    return GrueblerCount(links, joints, 2 if mechanism.only_upright else 0)


def unit_rows(mechanism: Mechanism, rows: Rows) -> Array:
    """Rows (R, K) in the columns' units, each of length one, those that nothing moves zero; no lengths."""
    unit = rows.jacobian * mechanism.units
    lengths = np.linalg.norm(unit, axis=1, keepdims=True)
    moved = lengths > _UNMOVED * lengths.max(initial=0.0)
    unit = np.asarray(np.divide(unit, lengths, out=np.zeros_like(unit), where=moved), np.float64)
    unit[:, mechanism.columns("length")] = 0.0
    return unit


def rank(unit: Array) -> int:
    """Rank of unit rows (R, K)."""
    return int(np.linalg.matrix_rank(unit, tol=_DEPENDENT)) if unit.size else 0


def null_space(unit: Array, moving: NDArray[np.intp]) -> Array:
    """(K, F) orthonormal directions in some columns that unit rows (R, K) leave free."""
    free = np.zeros((unit.shape[1], len(moving) - rank(unit[:, moving])))
    directions = np.linalg.svd(unit[:, moving])[2] if len(unit) else np.eye(len(moving))
    free[moving] = directions[len(moving) - free.shape[1] :].T
    return free


def redundant_rows(unit: Array, names: list[str]) -> dict[str, tuple[str, ...]]:
    """Rows of (R, K) that are sums of rows before them -> those."""
    independent: list[int] = []
    found = {}
    for row in range(len(unit)):
        if rank(unit[[*independent, row]]) > len(independent):
            independent.append(row)
            continue
        shares = np.abs(np.linalg.lstsq(unit[independent].T, unit[row], rcond=_DEPENDENT)[0])
        chosen = np.flatnonzero(shares > _COMPANION * shares.max(initial=0.0))
        found[names[row]] = tuple(names[independent[other]] for other in chosen)
    return found


def motion_parts(mechanism: Mechanism, unit: Array, free: Array) -> MotionParts:
    """Take the null space (K, F) of unit rows (R, K) apart."""
    equipment = mechanism.equipment
    own = [joint.name for joint in equipment.joints] if equipment else []
    columns = {str(name): mechanism.columns("place", "joint", names=[name]) for name in dict.fromkeys(mechanism.names)}
    columns = {name: of_joint for name, of_joint in columns.items() if len(of_joint)}
    joints = [name for name, of_joint in columns.items() if mechanism.kinds[of_joint[0]] == "joint" or name in own]
    untouched = {n: len(columns[n]) for n in joints if np.abs(unit[:, columns[n]]).max(initial=0.0) < _UNMOVED}
    leading = [name for name in joints if name in own and name not in untouched]
    concerned = [name for name in columns if name not in untouched and name not in leading]
    root = np.arange(6)
    whole = null_space(unit, root)
    if whole.shape[1] < 6 and equipment is not None:
        # Where the machine stands, its place beside the body is that of the body in the world.
        concerned.remove(equipment.name)
    led, stuck, rest = [], [], _across(free, whole)
    for name in leading:
        if np.linalg.norm(rest[columns[name]]) < _MOVES and np.linalg.norm(free[columns[name]]) < _MOVES:
            stuck.append(name)
        motions = []
        for column in columns[name]:
            # The projection of a unit vector is the least motion with it; what is across of that leaves it alone.
            motion = rest @ rest[column]
            if motion[column] > _MOVES**2:
                motions.append(motion / np.linalg.norm(motion[columns[name]]))
                rest = _across(rest, motion[:, None])
        if motions:
            others = {other: columns[other] for other in (*leading, *concerned) if other != name}
            led.append(NullMotion(name, len(motions), _shares(np.stack(motions), others)))
    return MotionParts(
        as_a_whole=whole.shape[1],
        untouched=untouched,
        led=tuple(led),
        stuck=tuple(stuck),
        others=rest.shape[1] - sum(untouched.values()),
        of_others=tuple(name for name in concerned if np.linalg.norm(rest[columns[name]]) > _MOVES),
    )


def _shares(motions: Array, columns: Mapping[str, NDArray[np.intp]]) -> dict[str, float]:
    """How much joints move at most in motions (M, K), those that do so noticeably, the most first."""
    shares = {name: float(np.linalg.norm(motions[:, own], axis=1).max()) for name, own in columns.items()}
    least = max(_NOTICED * max(shares.values(), default=0.0), _MOVES)
    return {name: share for name, share in sorted(shares.items(), key=lambda pair: -pair[1]) if share > least}


def _across(free: Array, directions: Array) -> Array:
    """Orthonormal directions of a space (K, F) across some of its own (K, N)."""
    across: Array = free @ null_space(directions.T @ free, np.arange(free.shape[1]))
    return across


def _rank_along(
    mechanism: Mechanism, start: Configuration, apart: tuple[str, ...], free: Array
) -> tuple[int, int] | None:
    """Least and greatest rank on some paths through what the constraints permit."""
    random = np.random.default_rng(1)
    moving, ground = mechanism.columns("place", "joint"), mechanism.poses(start)
    found = []
    for _ in range(_PATHS if free.shape[1] else 0):
        configuration, direction = start, np.asarray(random.normal(size=len(free)))
        for _ in range(_STEPS):
            unit = unit_rows(mechanism, mechanism.constraints(configuration, apart, ground))
            found.append(rank(unit))
            across = null_space(unit, moving)
            direction = across @ (across.T @ direction)
            direction = direction / np.abs(direction).max()
            configuration = mechanism.moved(configuration, _STEP * mechanism.units * direction)
            configuration = projected(mechanism, configuration, moving, apart, ground)
            left = mechanism.constraints(configuration, apart, ground).residuals
            if np.abs(left).max(initial=0.0) > _STILL_CLOSED:
                break  # at the end of its reach
    return (min(found), max(found)) if found else None


def _row_names(rows: Rows) -> list[str]:
    """A name for each row, such as "binding_left: place, up", by the direction that it is nearest to."""
    names = [""] * len(rows.owners)
    for owner in dict.fromkeys(rows.owners):
        for turn, text in ((True, "turn about"), (False, "place,")):
            own = np.flatnonzero((np.array(rows.owners) == owner) & (rows.turns == turn))
            # A different word for each row, the nearest on the whole.
            _, words = linear_sum_assignment(-np.abs(rows.directions[own]))
            for row, word in zip(own, words, strict=True):
                names[row] = f"{owner}: {text} {_DIRECTIONS[word]}"
    return names
