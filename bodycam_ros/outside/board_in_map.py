"""Where the board is in a map: at its origin; but z of the map is up, whatever axis of the board is."""

import numpy as np

from bodycam_ros.errors import MapError
from bodycam_ros.geometry import Array, rigid
from bodycam_ros.registration.reference_map import MAP_R_BOARD, ReferenceMap
from bodycam_ros.shown import shown

_NO_ROTATION = 1e-6
_RESIDUAL = "board_residual"


def board_in_map(reference_map: ReferenceMap) -> Array | None:
    """map_T_board (4, 4), or None where the map was made without a board.

    Maps of before do not say how their board lay; most lie flat, and then the two frames are one.

    Raises:
        MapError: what the map says is no rotation.
    """
    summary = reference_map.summary
    if MAP_R_BOARD not in summary:
        return None if summary.get(_RESIDUAL, _RESIDUAL) is None else np.eye(4)
    if (axes := summary[MAP_R_BOARD]) is None:
        return None
    try:
        R = np.array(axes, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        R = np.zeros(0)
    if R.shape != (3, 3) or not np.abs(R.T @ R - np.eye(3)).max() < _NO_ROTATION or np.linalg.det(R) < 0.0:
        raise MapError(
            f"{MAP_R_BOARD} of the map must be a rotation, three rows of three, not {shown(axes)}; build the map again "
            "with 'bodycam map'"
        )
    return rigid(R, np.zeros(3))
