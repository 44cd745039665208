"""The equipment's place at one instant: anywhere at first, near a prediction afterwards."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body_state import SegmentPose
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.estimation.equipment_fit import BODY_M, EquipmentFit, FittedEquipment, HeldPoints, Prior
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
