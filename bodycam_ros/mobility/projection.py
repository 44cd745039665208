"""Back onto what the constraints permit: Gauss-Newton's shortest steps until the loops are closed."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.mobility.mechanism import Configuration, Mechanism, Rows, stacked

_ITERATIONS = 40
_LONGEST_STEP = 0.5  # [rad], or of a limb's length
_CONVERGED = 1e-13
_DEPENDENT = 1e-9  # of the largest singular value


def projected(
    mechanism: Mechanism,
    start: Configuration,
    columns: NDArray[np.int_],
    without: Collection[str] = (),
    standing: Array | None = None,
) -> Configuration:
    """The configuration near another that closes all loops but some, as nearly as the chosen columns can.

    Args:
        mechanism: body and equipment.
        start: near a closed one.
        columns: that may move.
        without: joints that are left open.
        standing: (S, 4, 4) where segments that stand are; None: they, and what may not lean, may be anywhere.
    """
    units = mechanism.column_units[columns]
    configuration = start
    for _ in range(_ITERATIONS):
        rows = constraints(mechanism, configuration, without, standing)
        J = rows.jacobian[:, columns] * units
        step = np.linalg.lstsq(J, -rows.residuals, rcond=_DEPENDENT)[0]
        length = float(np.abs(step).max(initial=0.0))
        full = np.zeros(mechanism.column_count)
        full[columns] = units * step * min(1.0, _LONGEST_STEP / max(length, _CONVERGED))
        configuration = mechanism.moved(configuration, full)
        if length < _CONVERGED:
            break
    return configuration


def constraints(
    mechanism: Mechanism, configuration: Configuration, without: Collection[str] = (), standing: Array | None = None
) -> Rows:
    """All rows that hold: of the loops but some, of what may not lean, and of what stands, if it is said where."""
    rows = mechanism.loop_rows(configuration)
    kept = [row for row, owner in enumerate(rows.owners) if owner not in without]
    of_loops = Rows(
        tuple(rows.owners[row] for row in kept),
        tuple(rows.kinds[row] for row in kept),
        rows.residuals[kept],
        rows.jacobian[kept],
    )
    if standing is None:
        return of_loops
    stands = mechanism.standing_rows(configuration, standing)
    upright = [mechanism.upright_rows(configuration)] if mechanism.only_upright else []
    return stacked([of_loops, stands, *upright], mechanism.column_count)
