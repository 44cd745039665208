"""What the solver says about the body at one instant."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class BodyState:
    """The pose of every segment at one instant.

    Attributes:
        stamp_ns: the instant [ns].
        segments: (S) names, in the order of ``BodyModel.segments``.
        world_T_segment: (S, 4, 4) poses [m].
        root_covariance: (6, 6) of the root segment's pose, rotation [rad^2] first, then translation [m^2],
            both in the root segment's axes (gtsam's order and tangent).
        cameras_used: how many cameras spoke at this instant.
        predicted: whether no camera spoke, so that the state follows from motion alone.
    """

    stamp_ns: int
    segments: tuple[str, ...]
    world_T_segment: NDArray[np.float64]
    root_covariance: NDArray[np.float64]
    cameras_used: int
    predicted: bool
