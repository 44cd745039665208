"""How equipment moves by itself: parts with inertia keep their speed, and lead the limbs that hold them.

Forwards such a hinge goes on at its speed. Over a whole recording its trajectory joins the speeds that were measured
before and after a gap, by as many turns as fit best between them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.estimation.attachments import ActiveAttachments
from bodycam_ros.estimation.estimate import Coordinates
from bodycam_ros.estimation.measurements import JointRotations
from bodycam_ros.estimation.motion_model import LASTS_S, MotionModel, MotionPrior, MotionSettings
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.tangent import TreeTangent

_LED = 600.0  # [rad/s^2] of joints of limbs that a machine leads: their own motion prior must not hold it up
_CONSTANT = 1e-12  # [m^2/s^3] of unknown lengths
_KEPT_S = 100.0  # [s] in which a hinge that keeps its speed loses it
_COAST_RAD = 0.01  # sigma of such a hinge about its trajectory in each state: predicted limbs must not hold it up
_ENDS_S = 0.25  # before and after a gap, that give the motion at its ends: most of a stroke of a pedal


class EquipmentMotion:
    """Motion prior of the equipment's joints.

    Args:
        body: with the equipment.
        equipment: how its segments move.
        motion: how suddenly segments change their motion, where the equipment's file has none.

    Attributes:
        accelerations: (E, 6) of the segments [rad/s^2], [m/s^2].
        coasting_rows: in the body's ``tree_joints``, of hinges whose child keeps its speed.
    """

    def __init__(self, body: BodyModel, equipment: Equipment, motion: MotionSettings) -> None:
        self._body, self._attachments = body, equipment.attachments
        self._row = {name: row for row, name in enumerate(equipment.segments)}
        usual = np.repeat([motion.angular_acceleration_sigma, motion.acceleration_sigma], 3)
        self.accelerations = np.tile(usual, (len(self._row), 1))
        for row, moves in enumerate(equipment.segments.values()):
            if moves.angular_acceleration_sigma is not None:
                self.accelerations[row, :3] = moves.angular_acceleration_sigma
            if moves.acceleration_sigma is not None:
                self.accelerations[row, 3:] = moves.acceleration_sigma
        self.coasting_rows = [
            row
            for row, joint in enumerate(body.tree_joints)
            if joint.type == "hinge" and joint.child in self._row and equipment.segments[joint.child].keeps_speed
        ]
        self.reset()

    def reset(self) -> None:
        """Forget which hinges were driven."""
        self._driven: set[int] = set()

    def _held_below(self, joint: Joint) -> list[str]:
        """Attachments to a joint's child and to what hangs on it."""
        below = self._body.moves[:, self._body.joint_row[joint.name]]
        return [each.name for each in self._attachments if below[self._body.segment_index[each.equipment_segment]]]

    def is_driven(self, row: int, active: ActiveAttachments | None) -> bool:
        """Whether an observed limb drives the child of a joint of the tree."""
        return active is not None and active.drive(self._held_below(self._body.tree_joints[row]))

    def prior(self, model: MotionModel, active: ActiveAttachments) -> MotionPrior:
        """How the equipment's coordinates move, and those of limbs that it leads."""
        tangent = model.tangent
        density, fade_s = np.full(tangent.count, np.nan), model.fade_s.copy()
        for row, joint in enumerate(tangent.tree.tree_joints):
            if joint.child in self._row:
                columns, sigmas = tangent.columns[row], self.accelerations[self._row[joint.child]]
                turns = tangent.twists[row][:3].any(axis=0)
                density[columns] = np.where(turns, sigmas[0], sigmas[3]) ** 2 * LASTS_S
            elif joint.child in tangent.tree.equipment_segments:
                density[tangent.columns[row]] = _CONSTANT
        for row in self.coasting_rows:
            fade_s[tangent.columns[row]] = _KEPT_S
            density[self._led_columns(row, tangent, active)] = _LED**2 * LASTS_S
        return MotionPrior(density, fade_s)

    def _led_columns(self, row: int, tangent: TreeTangent, active: ActiveAttachments) -> NDArray[np.bool_]:
        """(K,) coordinates of the limbs that hold a hinge's child, while none of them drives it."""
        led, held = np.zeros(tangent.count, bool), self._held_below(self._body.tree_joints[row])
        if not active.drive(held):
            for each in self._attachments:
                if each.name in held and active.active[each.name]:
                    for above in np.flatnonzero(self._body.moves[self._body.segment_index[each.body_segment]]):
                        led[tangent.columns[above]] = True
        return led

    def coasting(self, at: Coordinates, active: ActiveAttachments | None) -> JointRotations:
        """Hinges that were driven and are not now, where the prediction has them; nothing where ``active`` is None."""
        driven = {row for row in self.coasting_rows if self.is_driven(row, active)}
        self._driven |= driven
        rows = sorted(self._driven - driven) if active is not None else []
        return coasting(rows, at.joints[rows, :3, :3])


def coasting(rows: Sequence[int], rotations: Array) -> JointRotations:
    """Hinges, by their rows in ``tree_joints``, that are at rotations (U, 3, 3) of their trajectories."""
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
    """Speed [rad/s] and acceleration [rad/s^2] at one end of a gap, by the angles beyond; None without any."""
    end = place
    while (
        0 <= end + side < len(driven) and driven[end + side] and abs(stamps_s[end + side] - stamps_s[place]) < _ENDS_S
    ):
        end += side
    if end == place:
        return None
    beyond = np.arange(min(place, end), max(place, end) + 1)
    curve = np.polyfit(stamps_s[beyond] - stamps_s[place], np.unwrap(angles[beyond]), min(2, len(beyond) - 1))
    return float(curve[-2]), float(2.0 * curve[-3]) if len(curve) > 2 else 0.0
