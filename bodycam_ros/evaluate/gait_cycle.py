"""Joint angles in the sagittal plane over the gait cycle: mean and spread over the strides of each side.

Signs are those of the ISB (Wu et al. 2002, 2005): flexion, and dorsiflexion of the ankle, are positive. Zero is the
N-pose. The angles are those of ``anatomical_angles``, not Cardan angles.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.evaluate.gait import Stride
from bodycam_ros.geometry import Array

CYCLE_PERCENT: Array = np.linspace(0.0, 100.0, 101)
"""(101,) from a contact of a foot to its next [% of the stride]."""

CONVENTION = (
    "flexion (of the ankle: dorsiflexion) is positive, as the ISB has it (Wu et al. 2002, 2005); zero is the N-pose"
)


@dataclass(frozen=True, eq=False)
class CycleAngle:
    """The angle of a joint over the gait cycle.

    Attributes:
        strides: number of strides N of the joint's side.
        mean: (101,) over the strides [deg].
        sd: (101,) standard deviation over the strides, with N - 1 [deg]; NaN of a single stride.
    """

    strides: int
    mean: Array
    sd: Array

    @property
    def peak(self) -> tuple[float, float]:
        """The most flexion of the mean [deg], and where it is [% of the stride]."""
        at = int(self.mean.argmax())
        return float(self.mean[at]), float(CYCLE_PERCENT[at])

    @property
    def trough(self) -> tuple[float, float]:
        """The least flexion of the mean [deg], and where it is [% of the stride]."""
        at = int(self.mean.argmin())
        return float(self.mean[at]), float(CYCLE_PERCENT[at])


def cycle_angles(
    seconds: Array, angles: Mapping[tuple[str, str], Array], strides: Sequence[Stride]
) -> dict[tuple[str, str], CycleAngle]:
    """(joint, side) -> its angle over the gait cycle of that side; sides without a stride are left out.

    Args:
        seconds: (T,) of the angles, increasing [s].
        angles: (joint, side) -> (T,) [deg].
        strides: on the clock of ``seconds``.
    """
    found = {}
    for (joint, side), angle in angles.items():
        own = [stride for stride in strides if stride.side == side]
        if own:
            times = [stride.start_s + (stride.end_s - stride.start_s) * CYCLE_PERCENT / 100.0 for stride in own]
            curves = np.array([np.interp(each, seconds, angle) for each in times])
            sd = curves.std(axis=0, ddof=1) if len(own) > 1 else np.full(len(CYCLE_PERCENT), np.nan)
            found[joint, side] = CycleAngle(len(own), curves.mean(axis=0), sd)
    return found
