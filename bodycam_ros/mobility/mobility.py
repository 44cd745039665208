"""What a body with its equipment can do, before anything is solved: freedoms, null motions, rows said twice (B 3)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.geometry import Array
from bodycam_ros.mobility.angle_limits import AngleLimits
from bodycam_ros.mobility.contradiction import Contradiction, without_contradictions
from bodycam_ros.mobility.gruebler import GrueblerCount, gruebler_count
from bodycam_ros.mobility.mechanism import Configuration, Mechanism
from bodycam_ros.mobility.null_motion import MotionParts, motion_parts
from bodycam_ros.mobility.projection import constraints, projected
from bodycam_ros.mobility.row_names import row_names
from bodycam_ros.mobility.row_rank import dependent_rows, null_space, rank, unit_rows

_STEP, _STEPS = 0.12, 20  # [rad], or of a limb's length
_WANDERINGS = 3
_STILL_CLOSED = 1e-6  # [sigma]
_NOTICED_RAD = np.radians(1.0)


@dataclass(frozen=True)
class Mobility:
    """What was found.

    Attributes:
        count: Gruebler's.
        rows: how many constraint rows there are.
        rank: how many of them are independent where the loops are closed.
        rank_along: least and greatest along motions that keep them closed; None: nothing moves.
        freedoms: how many there are in truth.
        parts: what moves with what.
        redundant: row -> rows that say the same.
        contradictions: loops that do not close; the rest is found without them.
        longer: what is unknown -> by how much it is more than said (3), and the sigma (3) [m].
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
    configuration, contradictions = without_contradictions(mechanism)
    apart = tuple(contradiction.name for contradiction in contradictions)
    moving = mechanism.columns("place", "joint")
    configuration = projected(mechanism, configuration, moving, apart)
    rows = constraints(mechanism, configuration, apart, mechanism.poses(configuration))
    unit = unit_rows(rows.jacobian * mechanism.column_units)
    unit[:, mechanism.columns("length")] = 0.0
    names = row_names(mechanism, configuration, rows)
    free = _embedded(unit, moving)
    return Mobility(
        count=gruebler_count(mechanism),
        rows=len(unit),
        rank=rank(unit),
        rank_along=_rank_along(mechanism, configuration, apart, free),
        freedoms=free.shape[1],
        parts=motion_parts(mechanism, unit, free),
        redundant={names[found.row]: tuple(names[row] for row in found.said_by) for found in dependent_rows(unit)},
        contradictions=contradictions,
        longer={
            name: (mechanism.longer_by(configuration, name), sigma) for name, sigma in mechanism.length_sigmas.items()
        },
        beyond_limits={
            name: beyond
            for name, beyond in AngleLimits(mechanism.body).beyond(configuration.joint_motion).items()
            if abs(beyond[1]) > _NOTICED_RAD
        },
    )


def _embedded(unit: Array, moving: NDArray[np.int_]) -> Array:
    """(K, F) null space of unit rows in some of their columns."""
    within = null_space(unit[:, moving])
    free = np.zeros((unit.shape[1], within.shape[1]))
    free[moving] = within
    return free


def _rank_along(
    mechanism: Mechanism, start: Configuration, apart: tuple[str, ...], free: Array
) -> tuple[int, int] | None:
    """Least and greatest rank on some ways through what the constraints permit."""
    random = np.random.default_rng(1)
    moving, units = mechanism.columns("place", "joint"), mechanism.column_units
    standing = mechanism.poses(start)
    found = []
    for _ in range(_WANDERINGS if free.shape[1] else 0):
        configuration, direction = start, np.asarray(random.normal(size=len(free)))
        for _ in range(_STEPS):
            rows = constraints(mechanism, configuration, apart, standing)
            unit = unit_rows(rows.jacobian * units)
            found.append(rank(unit[:, moving]))
            across = _embedded(unit, moving)
            direction = across @ (across.T @ direction)
            direction = direction / np.abs(direction).max()
            configuration = mechanism.moved(configuration, _STEP * units * direction)
            configuration = projected(mechanism, configuration, moving, apart, standing)
            left = constraints(mechanism, configuration, apart, standing).residuals
            if np.abs(left).max(initial=0.0) > _STILL_CLOSED:
                break  # at the end of its reach
    return (min(found), max(found)) if found else None
