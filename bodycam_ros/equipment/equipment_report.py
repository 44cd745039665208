"""How a body is coupled to its equipment at one instant, as the solver says it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array


@dataclass(frozen=True, eq=False)
class EquipmentReport:
    """K attachments, and L lengths that the file leaves open.

    Attributes:
        name: of the equipment.
        placed: whether it is known where the equipment is; until then nothing is coupled to it.
        attachments: (K) names.
        engaged: (K,) whether each held at this instant.
        deviations: (K,) distance between its points on the body and on the equipment, the mean over them [m]; NaN while
            the equipment is not placed.
        lengths: (L) what was unknown, ``<attachment or joint>_<x, y or z>``.
        priors: (L,) how far the file says they may be off [m].
        values: (L,) as far as it is known [m].
        sigmas: (L,) [m].
    """

    name: str
    placed: bool
    attachments: tuple[str, ...]
    engaged: NDArray[np.bool_]
    deviations: Array
    lengths: tuple[str, ...]
    priors: Array
    values: Array
    sigmas: Array
