"""What is published about one instant of the body."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.solving.body_state import BodyState


@dataclass(frozen=True)
class BodyOutput:
    """What is published about one instant.

    Attributes:
        state: poses of all segments.
        joint_names: A names, in constant order.
        positions: (A,) continuous joint angles [rad].
        velocities: (A,) [rad/s].
        root_velocity: (6,) angular [rad/s] then linear [m/s], in the root's axes.
    """

    state: BodyState
    joint_names: tuple[str, ...]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    root_velocity: NDArray[np.float64]
