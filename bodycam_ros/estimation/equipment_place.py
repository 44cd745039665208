"""The equipment's place at one instant: anywhere at first, near a prediction afterwards."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.equipment import Attachment, Equipment, UnknownLengths, attachment_joint
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.attachment_watch import Holding
from bodycam_ros.estimation.coupling_settings import CouplingSettings
from bodycam_ros.estimation.equipment_fit import BODY_M, EquipmentFit, FittedEquipment, HeldPoints, Prior
from bodycam_ros.estimation.measurements import ClosedJoint
from bodycam_ros.geometry import exp_so3, inverse, nearest_rotation, rigid, transform_points
from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]

_ANGLES = 12
"""Starts of a hinge that turns for ever."""

_KNOWN = np.repeat([0.35, 0.3], 3)
"""[rad], [m] a root that the attachments know no better than this is not placed yet."""

_STEPS_NEAR = 6
_ANYHOW = 10.0  # [rad], [m] no opinion

_LEAST_LEVER_M = 0.01
"""Points nearer to an axis than this do not feel a turn about it."""


@dataclass(frozen=True, eq=False)
class Placed:
    """Where the equipment is.

    Attributes:
        poses: (E, 4, 4) world_T_segment.
        root_sigmas: (6) of the root's [rad], [m].
    """

    poses: Array
    root_sigmas: Array


class EquipmentPlace:
    """Finds the equipment from what the body holds of it at one instant.

    Args:
        equipment: its attachments and how upright it is.
        tree: its own joints, parents first.
        fit: that improves a start.
    """

    def __init__(self, equipment: Equipment, tree: Sequence[Joint], fit: EquipmentFit) -> None:
        self._equipment, self._fit = equipment, fit
        endless = [joint for joint in tree if joint.type == "hinge" and joint.limits is None]
        # Pedals follow the foot once their crank is found.
        outer = {joint.child for joint in endless}
        self._endless = [joint for joint in endless if joint.parent not in outer]
        self._turning = outer

    def nominal(self, world_T_root: Array, angles: Mapping[str, float] | None = None) -> Array:
        """Poses (E, 4, 4) with all joints at zero, but hinges at angles [rad]."""
        motions = np.tile(np.eye(4), (len(self._fit.chain.freedoms), 1, 1))
        return self._bent(world_T_root, motions, angles or {})

    def anywhere(self, held: HeldPoints, lengths: Array) -> Placed | None:
        """The best fit of all; None while what is held does not say where the equipment is."""
        if not any(holds[0] for holds in held.holds.values()):
            return None
        starts = [
            self._hung_on_body(held, angles) for angles in self._angles(self._endless[0] if self._endless else None)
        ]
        best = min((self._fit.solve(start[None], lengths, held) for start in starts), key=_cost)
        if (best.root_sigmas > _KNOWN)[self._felt(best.poses[0])].any():
            return None
        return Placed(best.poses[0], best.root_sigmas)

    def _felt(self, poses: Array) -> NDArray[np.bool_]:
        """(6) which turns and shifts of the root a point that is held would feel: no turn of a bar about itself."""
        root_T_world = inverse(poses[self._fit.row[self._equipment.root]])
        points = []
        for attachment in self._equipment.attachments:
            root_T_segment = root_T_world @ poses[self._fit.row[attachment.equipment_segment]]
            points.append(transform_points(root_T_segment, attachment.on_equipment))
        about_axes = np.linalg.norm(np.cross(np.concatenate(points)[:, None], np.eye(3)), axis=2).max(axis=0)
        return np.append(about_axes > _LEAST_LEVER_M, np.ones(3, bool))

    def by_camera(self, held: HeldPoints, lengths: Array, own: Sequence[SegmentPose]) -> Placed:
        """Where it is by cameras on its root."""
        surest = min(own, key=lambda seen: float(np.trace(seen.covariance)))
        sigmas = np.full((len(self._fit.row), 6), _ANYHOW)
        root = self._fit.row[self._equipment.root]
        sigmas[root] = np.sqrt(np.diag(surest.covariance))
        prior = Prior(self.nominal(surest.world_T_segment), sigmas)
        return Placed(self.around(held, lengths, prior), sigmas[root])

    def near(self, held: HeldPoints, lengths: Array, prior: Prior) -> Array:
        """Poses (E, 4, 4) fitted from a prediction."""
        if not any(holds[0] for holds in held.holds.values()):
            return prior.poses.copy()
        near: Array = self._fit.solve(prior.poses[None], lengths, held, prior, _STEPS_NEAR).poses[0]
        return near

    def around(self, held: HeldPoints, lengths: Array, prior: Prior) -> Array:
        """Poses (E, 4, 4) near a prediction of which hinges that turn for ever need not be anywhere near."""
        loose = prior.sigmas.copy()
        loose[[row for name, row in self._fit.row.items() if name in self._turning]] = _ANYHOW
        poses = prior.poses
        for endless in self._endless or (None,):
            starts = [self._turned(poses, angles) for angles in self._angles(endless)]
            fits = [self._fit.solve(start[None], lengths, held, Prior(prior.poses, loose)) for start in starts]
            poses = min(fits, key=_cost).poses[0]
        return poses

    def _turned(self, poses: Array, angles: Mapping[str, float]) -> Array:
        """Poses (E, 4, 4) with some hinges at angles [rad], and what hangs on them."""
        chain = self._fit.chain
        return self._bent(poses[chain.root], chain.tree.joint_poses(poses, chain.slides), angles)

    def _bent(self, world_T_root: Array, motions: Array, angles: Mapping[str, float]) -> Array:
        """Poses (E, 4, 4) of the root's (4, 4) and joint motions (J, 4, 4), with some hinges at angles [rad]."""
        tree = self._fit.chain.tree
        for name, angle in angles.items():
            row = tree.joint_row[name]
            motions[row] = rigid(tree.tree_joints[row].hinge_rotation(np.array(angle)), np.zeros(3))
        return tree.forward_kinematics(world_T_root, motions)

    def _angles(self, endless: Joint | None) -> list[dict[str, float]]:
        if endless is None:
            return [{}]
        return [{endless.name: angle} for angle in np.linspace(-np.pi, np.pi, _ANGLES, endpoint=False).tolist()]

    def _hung_on_body(self, held: HeldPoints, angles: Mapping[str, float]) -> Array:
        """Poses (E, 4, 4) with joints at angles, moved as one to where the body holds them (Kabsch 1976)."""
        nominal = self.nominal(np.eye(4), angles)
        on_equipment, on_body, weights = [], [], []
        for attachment in self._equipment.attachments:
            if held.holds[attachment.name][0]:
                pose = nominal[self._fit.row[attachment.equipment_segment]]
                on_equipment.append(transform_points(pose, attachment.on_equipment))
                on_body.append(held.points[attachment.name][0])
                off = float(np.max(attachment.unknown))
                weights.append(1.0 / (np.square(attachment.sigmas) + off**2 + BODY_M**2))
        a, b, w = np.concatenate(on_equipment), np.concatenate(on_body), np.concatenate(weights)
        a_mean, b_mean = w @ a / w.sum(), w @ b / w.sum()
        scatter = (b - b_mean).T @ ((a - a_mean) * w[:, None])
        if np.isfinite(self._equipment.upright_sigma):
            # Standing upright, it only turns about the vertical.
            turn = np.arctan2(scatter[1, 0] - scatter[0, 1], scatter[0, 0] + scatter[1, 1])
            R = exp_so3(np.array([0.0, 0.0, turn]))
        else:
            R = nearest_rotation(scatter)
        moved: Array = rigid(R, b_mean - R @ a_mean) @ nominal
        return moved


def _cost(fitted: FittedEquipment) -> float:
    return fitted.cost


_KERNEL = 4.0
"""Sigmas from which on an attachment counts less and less: one that is let go must not bend a leg."""


class EquipmentPlaces:
    """Learns the unknown lengths of equipment, and makes the joints of an instant of them.

    Args:
        body: with the equipment.
        equipment: its attachments.
        tree: its own joints, parents first.
        lengths: what is unknown of it.
        settings: when attachments give way.

    Attributes:
        shifts: (L) how far what was unknown is from where it was said to be [m].
        sigmas: (L) how well that is known [m].
        own: its own joints, where they have been learned to be.
    """

    def __init__(
        self,
        body: BodyModel,
        equipment: Equipment,
        tree: Sequence[Joint],
        lengths: UnknownLengths,
        settings: CouplingSettings,
    ) -> None:
        self._row, self._attachments, self._tree = body.segment_index, equipment.attachments, tree
        self._lengths, self._settings = lengths, settings
        self.learn(np.zeros(len(lengths)), lengths.priors.copy())

    def learn(self, shifts: Array, sigmas: Array) -> None:
        """The lengths (L) are so, as far as is known by now [m]."""
        self.shifts, self.sigmas = shifts, sigmas
        self.own = [self._lengths.joint(joint, shifts) for joint in self._tree]
        self._shifted = {a.name: self._lengths.attachment(a, shifts) for a in self._attachments}
        self._held = {name: attachment_joint(attachment) for name, attachment in self._shifted.items()}
        self._unknown = {name: self._lengths.along_axes(name, sigmas) for name in self._shifted}

    def joints(self, path: Array, holding: Holding | None) -> list[ClosedJoint]:
        """What holds the equipment to the body, around poses (S, 4, 4) (B eq. 15).

        A place that is not known yet is as soft as that.
        """
        if holding is None:
            return []
        return [self._closed(a, self._ends(a, path), holding) for a in self._attachments if holding.engaged[a.name]]

    def _closed(self, attachment: Attachment, ends: tuple[Array, Array], holding: Holding) -> ClosedJoint:
        joint, unknown = self._held[attachment.name], self._unknown[attachment.name]
        assert joint.sigmas is not None  # set when it was made
        # What is unknown lies along the equipment's axes, the gap in those of the joint on the body.
        body, equipment = (pose[:3, :3] for pose in ends)
        joint_R_equipment = (body @ joint.child_T_joint[:3, :3]).T @ equipment
        covariance = np.diag(np.square(joint.sigmas))
        covariance[3:, 3:] += joint_R_equipment @ np.diag(unknown**2) @ joint_R_equipment.T
        return ClosedJoint(joint, np.linalg.inv(covariance), self._kernel(attachment, holding))

    def distance(self, name: str, world_T_segment: Array) -> float:
        """Mean distance of the points of an attachment [m], of poses (S, 4, 4)."""
        attachment = self._shifted[name]
        return float(attachment.distances(*self._ends(attachment, world_T_segment)).mean())

    def _ends(self, attachment: Attachment, world_T_segment: Array) -> tuple[Array, Array]:
        """Poses (4, 4) of its segments of the body and of the equipment."""
        body, equipment = self._row[attachment.body_segment], self._row[attachment.equipment_segment]
        return world_T_segment[body], world_T_segment[equipment]

    def _kernel(self, attachment: Attachment, holding: Holding) -> float:
        """Sigmas from which on an attachment gives way: unseen, nobody has let it go, and it may begin far off."""
        if attachment.name in holding.seen:
            return _KERNEL
        return max(_KERNEL, self._settings.release_distance / float(attachment.sigmas.min()))
