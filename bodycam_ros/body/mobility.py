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
from bodycam_ros.body.mechanism import Mechanism, project, solve
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import GIVES_M, held_rows

_DEPENDENT = 1e-7  # singular value of unit rows: loops are closed to 1e-12, so dependent rows are so to rounding
_UNMOVED = 1e-10  # of a unit row, or of a null motion squared: rounding
_NOTICED = 0.05  # of the largest share of a null motion


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
class Conflict:
    """A loop that does not close.

    Attributes:
        name: of the attachment, or of the body's own joint.
        apart_m: smallest possible distance of its points, the worst of them, while all others are closed [m].
        turned_rad: by how much it is then turned from what it permits [rad].
    """

    name: str
    apart_m: float
    turned_rad: float


@dataclass(frozen=True)
class Mobility:
    """Mobility of a mechanism, where its loops are closed.

    Attributes:
        count: Gruebler's.
        rows: number of constraint rows.
        rank: number of independent ones.
        freedoms: dimension of the null space.
        as_a_whole: degrees of freedom that move everything in the world together.
        coupled: joint of the equipment -> joints that move with it, those that move most first.
        stuck: joints of the equipment that cannot move.
        conflicts: loops that do not close; the rest is found without them.
    """

    count: GrueblerCount
    rows: int
    rank: int
    freedoms: int
    as_a_whole: int
    coupled: Mapping[str, tuple[str, ...]]
    stuck: tuple[str, ...]
    conflicts: tuple[Conflict, ...]


def mobility(body: BodyModel, equipment: Equipment | None = None) -> Mobility:
    """Count the degrees of freedom of a mechanism, close its loops and find its null motions.

    Raises:
        BodyError: the equipment does not fit the body.
    """
    equipment = None if equipment is None else fitted_equipment(equipment, body)
    mechanism = Mechanism(coupled_body(body, equipment), equipment)
    configuration, left_open = close_loops(mechanism)
    moving, columns = mechanism.moving, {name: own for name, own in mechanism.columns.items() if len(own)}
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
    beside = [] if equipment is None else [joint.name for joint in equipment.joints if joint.name in columns]
    stuck = tuple(name for name in beside if np.diag(projector)[columns[name]].max() < _UNMOVED)
    stretched = solve(mechanism, configuration, weak=left_open)[0] if left_open else configuration
    return Mobility(
        count=gruebler_count(mechanism),
        rows=len(unit),
        rank=_rank(unit),
        freedoms=free.shape[1],
        as_a_whole=6 - _rank(unit[:, columns[mechanism.body.root]]),
        coupled={name: _partners(projector, columns, name) for name in beside if name not in stuck},
        stuck=stuck,
        conflicts=tuple(Conflict(name, *mechanism.gap(stretched, name)) for name in sorted(left_open)),
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
