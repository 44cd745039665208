"""How the equipment moves by itself: what has inertia keeps its speed.

At once it goes on as it did. Over a whole recording it goes on from the speed that it had to the speed that it was
seen at again, by as many turns as fit best between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly

from bodycam_ros.body.equipment import Equipment, UnknownLengths
from bodycam_ros.estimation.measurements import SLIDES_M, JointRotations
from bodycam_ros.estimation.motion_model import MotionSettings
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint import LOOSE_M, Joint
from bodycam_ros.kinematics.tangent import TreeTangent
from bodycam_ros.kinematics.tree import KinematicTree


class EquipmentMotion:
    """Predicts the equipment's segments.

    Args:
        equipment: how its segments move.
        tree: its own joints, parents first.
        motion: how suddenly segments change their motion, where the equipment does not say.

    Attributes:
        keeping_joints: names of the hinges whose child keeps its speed.
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint], motion: MotionSettings) -> None:
        self._moves = list(equipment.segments.values())
        self._motion = motion
        self._row = {name: row for row, name in enumerate(equipment.segments)}
        self._tree = tuple(tree)
        self.keeping_joints = {
            joint.name for joint in tree if joint.type == "hinge" and equipment.segments[joint.child].keeps_speed
        }
        below = [{a.name for a in equipment.attachments if a.equipment_segment == name} for name in self._row]
        for joint in reversed(self._tree):
            below[self._row[joint.parent]] |= below[self._row[joint.child]]
        self._held_below = [frozenset(names) for names in below]

    def held_below(self, segment: str) -> frozenset[str]:
        """The attachments to a segment, and to those that hang on it."""
        return self._held_below[self._row[segment]]

    @property
    def accelerations(self) -> Array:
        """(E, 6) how suddenly segments change their motion [rad/s^2], [m/s^2]."""
        usual = [self._motion.angular_acceleration_sigma, self._motion.acceleration_sigma]
        accelerations = np.tile(np.repeat(usual, 3), (len(self._moves), 1))
        for row, moves in enumerate(self._moves):
            if moves.angular_acceleration_sigma is not None:
                accelerations[row, :3] = moves.angular_acceleration_sigma
            if moves.acceleration_sigma is not None:
                accelerations[row, 3:] = moves.acceleration_sigma
        return accelerations


@dataclass(frozen=True, eq=False)
class Freedom:
    """How a joint of the equipment moves.

    Attributes:
        joint: which.
        twists: (6, F) the directions in the joint's frame that are free.
        sigmas: (F) how far along them [rad], [m]; infinite where there is no opinion.
        columns: (F) among the unknowns of an instant.
    """

    joint: Joint
    twists: Array
    sigmas: Array
    columns: slice


class EquipmentChain:
    """Poses of the equipment's segments as functions of its root, its joints and its lengths.

    Args:
        equipment: its segments.
        tree: its own joints.
        lengths: what is unknown of it.

    Attributes:
        tree: its segments and joints.
        row: segment -> its row among the equipment's.
        root: row of the root.
        slides: (J, 3) along which axes its joints slide.
        freedoms: (J) of the joints, in the order of the tree.
        length_columns: (L) of the lengths among the unknowns; a tangent of the root comes first, then the joints.
        count: of all unknowns of an instant.
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint], lengths: UnknownLengths) -> None:
        self.tree = KinematicTree(equipment.name, equipment.root, tuple(equipment.segments), tuple(tree))
        self._tangent, self._lengths = TreeTangent(self.tree, SLIDES_M), lengths
        self.row, self.root = self.tree.segment_index, self.tree.segment_index[equipment.root]
        joints, twists, columns = self.tree.tree_joints, self._tangent.twists, self._tangent.columns
        self.slides = np.array([xi[3:].any(axis=1) for xi in twists], bool).reshape(-1, 3)
        sigmas = [np.array(joint.sigmas)[list(joint.free_rows(SLIDES_M))] for joint in joints]
        # What turns freely, or slides freely, has no sigma.
        sigmas = [
            np.where(xi[:3].any(axis=0) | (own >= LOOSE_M), np.inf, own) for xi, own in zip(twists, sigmas, strict=True)
        ]
        self.freedoms = [Freedom(*each) for each in zip(joints, twists, sigmas, columns, strict=True)]
        self.length_columns = self._tangent.count + np.arange(len(lengths))
        self.count = self._tangent.count + len(lengths)

    def motions(self, poses: Array, lengths: Array) -> Array:
        """Joint motions (T, J, 4, 4) of poses (T, E, 4, 4) and lengths (L): what joints hold is dropped."""
        motions = self.tree.joint_poses(poses, np.ones_like(self.slides))
        motions[..., :3, 3] = self.slides * (motions[..., :3, 3] - self._shifts(lengths))
        return motions

    def moved(self, root: Array, motions: Array, step: Array) -> tuple[Array, Array]:
        """Root (T, 4, 4) and joint motions (T, J, 4, 4) after a step (T, n) of the unknowns."""
        return self._tangent.moved(root, motions, step)

    def poses(self, root: Array, motions: Array, lengths: Array) -> tuple[Array, Array]:
        """Poses (T, E, 4, 4), and how their tangents follow from the unknowns (T, E, 6, n) (B eq. 3)."""
        longer = motions.copy()
        longer[..., :3, 3] += self._shifts(lengths)
        poses = self.tree.forward_kinematics(root, longer)
        J = np.zeros((*poses.shape[:-2], 6, self.count))
        J[..., : self._tangent.count] = self._tangent.segment_jacobians(poses)
        for row, joint in enumerate(self.tree.tree_joints):
            for number, axis in self._lengths.of(joint.name):
                column = slice(self.length_columns[number], self.length_columns[number] + 1)
                # A shift of the joint on its parent moves all that hangs on it along.
                below, along = self.tree.moves[:, row], poses[:, self.row[joint.parent], :3, axis]
                segment_R_world = np.swapaxes(poses[:, below, :3, :3], -1, -2)
                J[:, below, 3:, column] = segment_R_world @ along[:, None, :, None]
        return poses, J

    def _shifts(self, lengths: Array) -> Array:
        """(J, 3) by how much joints are elsewhere on their parents than given, in the joints' axes [m]."""
        shifts = [self._lengths.along_axes(j.name, lengths) @ j.parent_T_joint[:3, :3] for j in self.tree.tree_joints]
        return np.array(shifts).reshape(-1, 3)


_COAST_RAD = 0.01
"""How far such a hinge may be from its way, each instant: the limbs that are guessed must not hold it up."""

_TOLD_S = 0.25
"""Before and after a stretch, that tell the motion at its ends: most of a stroke of a pedal, which is not even."""

_LASTS_S = 2.0
"""How long a change of speed that was seen goes on: a rider who starts has his speed by then."""


def coasting(rows: Sequence[int], rotations: Array) -> JointRotations:
    """Hinges, by their rows in ``tree_joints``, that are on their way at rotations (U, 3, 3)."""
    return JointRotations(np.array(rows, np.int64), rotations, np.full((len(rows), 3), _COAST_RAD))


def on_the_way(angles: Array, stamps_s: Array, driven: NDArray[np.bool_]) -> Array:
    """Angles (T) [rad] with stretches that nobody drove filled in: with speed and acceleration of both ends.

    Args:
        angles: (T) continuous where it is driven.
        stamps_s: (T) [s].
        driven: (T) whether an angle is known.
    """
    filled = angles.copy()
    known = np.flatnonzero(driven)
    if not len(known):
        return filled
    for first, last in zip(known[:-1].tolist(), known[1:].tolist(), strict=True):
        if last - first < 2:
            # What is continuous stays so, whatever was added before.
            filled[last:] += 2.0 * np.pi * np.round((filled[first] - filled[last]) / (2.0 * np.pi))
            continue
        T = stamps_s[last] - stamps_s[first]
        ends = _motion(filled, stamps_s, driven, first, -1), _motion(filled, stamps_s, driven, last, 1)
        # An instant that is known alone has no speed; the other end tells it.
        told = [end for end in ends if end is not None] or [(0.0, 0.0)]
        (v0, a0), (v1, a1) = told[0], told[-1]
        lasts = min(1.0, (_LASTS_S / T) ** 2)
        a0, a1 = lasts * a0, lasts * a1
        # The jerk is least on the way that ends here.
        expected = filled[first] + T * (v0 + v1) / 2.0 + T**2 * (a0 - a1) / 12.0
        filled[last:] += 2.0 * np.pi * np.round((expected - filled[last]) / (2.0 * np.pi))
        way = BPoly.from_derivatives(stamps_s[[first, last]], [[filled[first], v0, a0], [filled[last], v1, a1]])
        filled[first + 1 : last] = way(stamps_s[first + 1 : last])
    return filled


def _motion(
    angles: Array, stamps_s: Array, driven: NDArray[np.bool_], place: int, side: int
) -> tuple[float, float] | None:
    """Speed [rad/s] and acceleration [rad/s^2] at one end of a stretch, by what is beyond; None if nothing is."""
    end = place
    while (
        0 <= end + side < len(driven) and driven[end + side] and abs(stamps_s[end + side] - stamps_s[place]) < _TOLD_S
    ):
        end += side
    if end == place:
        return None
    beyond = np.arange(min(place, end), max(place, end) + 1)
    curve = np.polyfit(stamps_s[beyond] - stamps_s[place], np.unwrap(angles[beyond]), min(2, len(beyond) - 1))
    return float(curve[-2]), float(2.0 * curve[-3]) if len(curve) > 2 else 0.0
