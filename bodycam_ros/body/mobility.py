"""Degrees of freedom of a body with its equipment: count (B eq. 9), rank and null space of the constraints."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Equipment, fitted_equipment
from bodycam_ros.body.equipment_search import close_loops
from bodycam_ros.body.mechanism import Configuration, Mechanism, project, solve
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import GIVES_M, held_rows

_DEPENDENT = 1e-7  # singular value of unit rows: loops are closed to 1e-12, so dependent rows are so to rounding
_UNMOVED = 1e-10  # of a unit row, or of a null motion squared: rounding
_NOTICED = 0.05  # of the largest share of a null motion
_NOTICED_RAD = np.radians(1.0)  # beyond limits


@dataclass(frozen=True)
class GrueblerCount:
    """The numbers of B eq. 9.

    Attributes:
        links: N, the segments that may move.
        joints: name -> f, for all g joints; the free joint to a machine removes no degree of freedom.
        leaning: degrees of freedom that a machine that may not lean loses.
    """

    links: int
    joints: Mapping[str, int]
    leaning: int

    @property
    def freedoms(self) -> int:
        """F = 6 N - sum (6 - f)."""
        return 6 * self.links - sum(6 - f for f in self.joints.values()) - self.leaning


@dataclass(frozen=True)
class Contradiction:
    """A loop that does not close.

    Attributes:
        name: of the attachment, or of the body's own joint.
        apart_m: smallest possible distance of its points, the worst of them, while all others are closed [m].
        turned_rad: by how much it is then turned from what it permits [rad].
        against: loops any one of which, released, would let it close.
    """

    name: str
    apart_m: float
    turned_rad: float
    against: tuple[str, ...]


@dataclass(frozen=True)
class Mobility:
    """Mobility of a mechanism, where its loops are closed.

    Attributes:
        count: Gruebler's.
        rows: number of constraint rows.
        rank: number of independent ones.
        freedoms: dimension of the null space.
        as_a_whole: degrees of freedom that move everything in the world together.
        untouched: joints that no loop constrains -> their degrees of freedom.
        within_loops: number of the remaining degrees of freedom.
        coupled: joint of the equipment -> joints that move with it, those that move most first.
        stuck: joints of the equipment that cannot move.
        redundant: loop -> number of its rows that follow from all others.
        contradictions: loops that do not close; the rest is found without them.
        lengths: unknown length -> by how much it exceeds the given one (3), and its sigma (3) [m].
        beyond_limits: joint angle -> its value, and by how much it is beyond its limits [rad].
    """

    count: GrueblerCount
    rows: int
    rank: int
    freedoms: int
    as_a_whole: int
    untouched: Mapping[str, int]
    within_loops: int
    coupled: Mapping[str, tuple[str, ...]]
    stuck: tuple[str, ...]
    redundant: Mapping[str, int]
    contradictions: tuple[Contradiction, ...]
    lengths: Mapping[str, tuple[Array, Array]]
    beyond_limits: Mapping[str, tuple[float, float]]


def mobility(body: BodyModel, equipment: Equipment | None = None) -> Mobility:
    """Count the degrees of freedom of a mechanism, close its loops and find its null motions.

    Raises:
        BodyError: the equipment does not fit the body.
    """
    equipment = None if equipment is None else fitted_equipment(equipment, body)
    mechanism = Mechanism(coupled_body(body, equipment), equipment)
    configuration, left_open = close_loops(mechanism)
    moving = mechanism.moving
    configuration = project(mechanism, configuration, moving, left_open)
    rows = mechanism.constraints(configuration, left_open, ground=True)
    unit = np.zeros((len(rows.owners), mechanism.tangent.count))
    unit[:, moving] = (rows.jacobian * mechanism.units)[:, moving]
    lengths = np.linalg.norm(unit, axis=1, keepdims=True)
    unit = np.divide(unit, lengths, out=np.zeros_like(unit), where=lengths > _UNMOVED * lengths.max(initial=0.0))

    free = null_space(unit[:, moving], rcond=_DEPENDENT) if len(unit) else np.eye(len(moving))
    null_motions = np.zeros((mechanism.tangent.count, free.shape[1]))
    null_motions[moving] = free
    # The projection of a unit vector is the smallest motion with it.
    projector = null_motions @ null_motions.T
    columns = {name: own for name, own in mechanism.columns.items() if len(own)}
    beside = () if mechanism.equipment is None else tuple(joint.name for joint in mechanism.equipment.joints)
    bases = (mechanism.body.root, *(() if mechanism.equipment is None else (mechanism.equipment.name,)))
    untouched = {
        name: len(own)
        for name, own in columns.items()
        if name not in bases and not np.abs(unit[:, own]).max(initial=0.0)
    }
    as_a_whole = 6 - _rank(unit[:, columns[mechanism.body.root]])
    leading = [name for name in beside if name in columns and name not in untouched]
    stuck = tuple(name for name in leading if np.abs(np.diag(projector)[columns[name]]).max() < _UNMOVED)
    rank = _rank(unit)
    angles = mechanism.limits.nearest_angles(configuration.joint_motion)
    excess = mechanism.limits.excess(angles)
    errors = mechanism.length_errors(configuration)
    redundant = {
        str(name): int(np.sum(rows.owners == name)) - rank + _rank(unit[rows.owners != name])
        for name in dict.fromkeys(rows.owners)
    }
    return Mobility(
        count=gruebler_count(mechanism),
        rows=len(unit),
        rank=rank,
        freedoms=free.shape[1],
        as_a_whole=as_a_whole,
        untouched=untouched,
        within_loops=free.shape[1] - as_a_whole - sum(untouched.values()),
        coupled={name: _partners(projector, columns, name) for name in leading if name not in stuck},
        stuck=stuck,
        redundant={name: count for name, count in redundant.items() if count},
        contradictions=_contradictions(mechanism, configuration, left_open),
        lengths={name: (errors[name], sigma) for name, sigma in mechanism.lengths.items()},
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


def _rank(unit: Array) -> int:
    return int(np.linalg.matrix_rank(unit, tol=_DEPENDENT)) if unit.size else 0


def _partners(projector: Array, columns: Mapping[str, NDArray[np.intp]], joint: str) -> tuple[str, ...]:
    """Joints that noticeably move with one in its smallest null motions, those that move most first."""
    motions = projector[:, columns[joint]]
    shares = {name: float(np.linalg.norm(motions[own])) for name, own in columns.items() if name != joint}
    least = _NOTICED * max(shares.values(), default=0.0) + np.sqrt(_UNMOVED)
    return tuple(name for name, share in sorted(shares.items(), key=lambda pair: -pair[1]) if share > least)


def _contradictions(mechanism: Mechanism, start: Configuration, left_open: set[str]) -> tuple[Contradiction, ...]:
    if not left_open:
        return ()
    stretched = solve(mechanism, start, weak=left_open)[0]
    found = []
    for name in sorted(left_open):
        against = []
        for other in mechanism.loops:
            without = (left_open - {name}) | {other}
            if other not in left_open:
                tried = solve(mechanism, stretched, without=without)[0]
                if mechanism.open_loops(tried) <= without:
                    against.append(other)
        found.append(Contradiction(name, *mechanism.gap(stretched, name), tuple(against)))
    return tuple(found)
