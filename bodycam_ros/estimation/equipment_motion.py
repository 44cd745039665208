"""How equipment moves by itself: parts with inertia keep their speed, and lead the limbs that hold them.

Forwards such a hinge keeps its speed. Over a whole recording its trajectory joins the speeds that were measured
before and after a gap, by as many turns as fit best between them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.equipment import Equipment
from bodycam_ros.estimation.attachments import ActiveAttachments
from bodycam_ros.estimation.factors.joint_rotations import JointRotations
from bodycam_ros.estimation.factors.motion import FADE_S, LASTS_S, MotionPrior
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import TreeTangent

_LED = 600.0  # [rad/s^2] of joints of limbs that a machine leads: their own motion prior must not hold it up
_KEPT_S = 100.0  # [s] in which a hinge that keeps its speed loses it
_COAST_RAD = 0.01  # sigma of such a hinge about its trajectory in each state: predicted limbs must not hold it up


class EquipmentMotion:
    """Motion prior of the equipment's joints.

    Args:
        tangent: coordinates of the body with the equipment.
        equipment: how its segments move.
        motion: how suddenly segments change their motion, where the equipment's file has none.

    Attributes:
        coasting_rows: in the body's ``tree_joints``, of hinges whose child keeps its speed.
    """

    def __init__(self, tangent: TreeTangent, equipment: Equipment, motion: MotionSettings) -> None:
        body, self._tangent = tangent.tree, tangent
        self.coasting_rows: list[int] = []
        self._density, self._fade_s = np.full(tangent.count, np.nan), np.full(tangent.count, FADE_S)
        for row, joint in enumerate(body.tree_joints):
            columns, moves = tangent.columns[row], equipment.segments.get(joint.child)
            if moves is not None:
                given = moves.angular_acceleration_sigma, moves.acceleration_sigma
                usual = motion.angular_acceleration_sigma, motion.acceleration_sigma
                sigmas = [own if sigma is None else sigma for sigma, own in zip(given, usual, strict=True)]
                self._density[columns] = np.where(tangent.turns[columns], *sigmas) ** 2 * LASTS_S
                if moves.keeps_speed and joint.type == "hinge":
                    self.coasting_rows.append(row)
                    self._fade_s[columns] = _KEPT_S
            elif joint.child in body.equipment_segments:
                self._density[columns] = 0.0  # unknown lengths stay
        ends = [
            (body.segment_index[e.body_segment], body.segment_index[e.equipment_segment]) for e in equipment.attachments
        ]
        limbs, held = np.array(ends, np.int64).reshape(-1, 2).T
        self._limbs, self._held = body.moves[limbs], body.moves[held]

    def driven(self, active: ActiveAttachments | None) -> frozenset[int]:
        """Rows of coasting hinges that an observed limb drives."""
        return frozenset(row for row in self.coasting_rows if self.is_driven(row, active))

    def is_driven(self, row: int, active: ActiveAttachments | None) -> bool:
        """Whether an observed limb drives the child of a joint of the tree, or what hangs on it."""
        return active is not None and bool((active.driving & self._held[:, row]).any())

    def prior(self, active: ActiveAttachments) -> MotionPrior:
        """Motion prior of the equipment's coordinates, and of those of limbs that it moves.

        It constrains what no observed limb drives.
        """
        density = self._density.copy()
        for row in self.coasting_rows:
            if not self.is_driven(row, active):
                held = self._limbs[active.engaged & self._held[:, row]]
                density[self._tangent.columns_of(np.any(held, axis=0))] = _LED**2 * LASTS_S
        return MotionPrior(density, self._fade_s)


def coasting(rows: Sequence[int], rotations: Array) -> JointRotations:
    """Hinges, by their rows in ``tree_joints``, that are at rotations (N, 3, 3) of their trajectories."""
    return JointRotations(np.array(rows, np.int64), rotations, np.full((len(rows), 3), _COAST_RAD))


def coasting_trajectory(angles: Array, stamps_s: Array, driven: NDArray[np.bool_]) -> Array:
    """Angles (T) [rad] with gaps filled in by the trajectory of least jerk between the motions at both ends.

    Args:
        angles: (T) continuous where it is driven.
        stamps_s: (T) [s].
        driven: (T) whether an angle is measured.
    """
    filled = angles.copy()
    known = np.flatnonzero(driven)
    for first, last in zip(known[:-1].tolist(), known[1:].tolist(), strict=True):
        expected = filled[first]
        if last - first > 1:
            T = stamps_s[last] - stamps_s[first]
            ends = [_end_motion(filled, stamps_s, driven, *end) for end in ((first, -1), (last, 1))]
            # A single measured angle has no speed; the other end gives it.
            measured = [end for end in ends if end is not None] or [(0.0, 0.0)]
            (v0, a0), (v1, a1) = measured[0], measured[-1]
            expected += T * (v0 + v1) / 2.0 + T**2 * (a0 - a1) / 12.0  # where the jerk is least
        filled[last:] += 2.0 * np.pi * np.round((expected - filled[last]) / (2.0 * np.pi))
        if last - first > 1:
            from scipy.interpolate import BPoly

            curve = BPoly.from_derivatives(stamps_s[[first, last]], [[filled[first], v0, a0], [filled[last], v1, a1]])
            filled[first + 1 : last] = curve(stamps_s[first + 1 : last])
    return filled


def _end_motion(
    angles: Array, stamps_s: Array, driven: NDArray[np.bool_], place: int, side: int
) -> tuple[float, float] | None:
    """Speed [rad/s] and acceleration [rad/s^2] at one end of a gap, by the angles within ``FADE_S`` of it, if any."""
    end = place
    while 0 <= end + side < len(driven) and driven[end + side] and abs(stamps_s[end + side] - stamps_s[place]) < FADE_S:
        end += side
    if end == place:
        return None
    beyond = np.arange(min(place, end), max(place, end) + 1)
    curve = np.polyfit(stamps_s[beyond] - stamps_s[place], np.unwrap(angles[beyond]), min(2, len(beyond) - 1))
    return float(curve[-2]), float(2.0 * curve[-3]) if len(curve) > 2 else 0.0
