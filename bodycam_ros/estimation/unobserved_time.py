"""How long nothing measured the body as a whole, and each of its joints: what is a guess rejects no camera."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kinematics.tangent import TreeTangent

Mask = NDArray[np.bool_]

_PREDICTED_S = 0.2  # how long a prediction of what is not observed may reject cameras: velocities fade as fast


class UnobservedTime:
    """Seconds since the body as a whole and each joint were last observed.

    Args:
        joints: how many there are.
    """

    def __init__(self, joints: int) -> None:
        self._seconds = np.zeros(1 + joints)

    def add(self, observed: Mask, joints_observed: Mask, dt_s: float) -> None:
        """Add a state with observed segments (S,) and joints (J,), so long after the one before [s]."""
        unmeasured = np.append(not observed.any(), ~joints_observed)
        self._seconds = np.where(unmeasured, self._seconds + dt_s, 0.0)

    def columns(self, tangent: TreeTangent) -> Mask:
        """(K,) coordinates that nothing measured for a while: no reason to reject a camera that does now.

        For a moment a prediction is as good as its covariance; then it is that of the pose prior, which is a guess.
        """
        unobserved = self._seconds > _PREDICTED_S
        return np.append(np.full(6, unobserved[0]), tangent.columns_of(unobserved[1:])[6:])
