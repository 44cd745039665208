"""Where joints are expected that worn cameras do not see, by whoever knows something of them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

_NO_OPINION_RAD = 100.0


@dataclass(frozen=True)
class ToldJoints:
    """What somebody else than the memory says of joints.

    Attributes:
        which: (J,) of the joints in ``BodyModel.tree_joints``.
        rotations: (J, 3, 3) of all joints; those of ``which`` count.
        sigma: how far a joint may be from it [rad].
    """

    which: NDArray[np.bool_]
    rotations: NDArray[np.float64]
    sigma: float


@dataclass(frozen=True)
class ExpectedJoints:
    """What the memory says of the joints that are not seen.

    Attributes:
        rows: (U) of the joints in ``BodyModel.tree_joints``.
        rotations: (U, 3, 3) joint rotations, within their limits.
        sigmas: (U, 3) how far a joint may be from it, about the child's axes [rad].
        steps: (U, 3, 3) how the expectation turned since the instant before, in the child's frame.
        lead: (U) share, 0 to 1, by which a joint moves as expected rather than as it moved when it was last seen.
    """

    rows: NDArray[np.int64]
    rotations: NDArray[np.float64]
    sigmas: NDArray[np.float64]
    steps: NDArray[np.float64]
    lead: NDArray[np.float64]

    def silenced(self, which: NDArray[np.bool_]) -> "ExpectedJoints":
        """The same with no opinion of some (U,) of the joints."""
        return replace(self, sigmas=np.where(which[:, None], _NO_OPINION_RAD, self.sigmas))

    def told(self, by: "ToldJoints") -> "ExpectedJoints":
        """The same, but for those of the joints that somebody else knows."""
        which = by.which[self.rows]
        return replace(
            self,
            rotations=np.where(which[:, None, None], by.rotations[self.rows], self.rotations),
            sigmas=np.where(which[:, None], by.sigma, self.sigmas),
        )
