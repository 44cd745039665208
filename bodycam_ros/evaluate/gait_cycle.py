"""Joint angles in the sagittal plane over the gait cycle: mean and spread over the strides of each side.

Signs are those of the ISB (Wu et al. 2002, 2005): flexion, and dorsiflexion of the ankle, are positive. Zero is the
N-pose. The angles are those of ``anatomical_angles``, not Cardan angles.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bodycam_ros.evaluate.anatomical_angles import planes_of
from bodycam_ros.evaluate.gait import SIDES, Stride
from bodycam_ros.geometry import Array

CYCLE_PERCENT: Array = np.linspace(0.0, 100.0, 101)
"""(101,) from a contact of a foot to its next [% of the stride]."""

JOINTS: Mapping[str, tuple[str, str]] = {
    "hip": ("thigh", "pelvis"),
    "knee": ("shin", "thigh"),
    "ankle": ("foot", "shin"),
    "shoulder": ("upper_arm", "torso"),
    "elbow": ("forearm", "upper_arm"),
}
"""Joint -> the segments below and above it, without their sides."""

CONVENTION = (
    "flexion (of the ankle: dorsiflexion) is positive, as the ISB has it (Wu et al. 2002, 2005); zero is the N-pose"
)

OF_WALKING = ("hip", "knee", "ankle")
_TRUNK = ("pelvis", "torso")


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


def flexion_angles(world_T_segment: Mapping[str, Array]) -> dict[tuple[str, str], Array]:
    """(joint, side) -> flexion (T,) [deg], of the joints of which both segments are known.

    Args:
        world_T_segment: segment -> (T, 4, 4) [m].
    """
    found = {}
    for joint, (child, parent) in JOINTS.items():
        for side in SIDES:
            below, above = f"{child}_{side}", parent if parent in _TRUNK else f"{parent}_{side}"
            if {below, above} <= set(world_T_segment):
                above_R_below = np.swapaxes(world_T_segment[above][:, :3, :3], 1, 2) @ world_T_segment[below][:, :3, :3]
                found[joint, side] = np.degrees(np.unwrap(planes_of(below, above_R_below)[:, 0]))
    return found


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
