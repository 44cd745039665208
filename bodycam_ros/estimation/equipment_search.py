"""The equipment's initial pose, from the body's attached points at one time; hinges that turn for ever are searched."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.equipment import Equipment
from bodycam_ros.estimation.equipment_fit import BODY_M, AttachedPoints, EquipmentFit, attached
from bodycam_ros.geometry import Array, exp_so3, inverse, nearest_rotation, rigid, transform_points

_STARTS = 12  # initial angles of a hinge that turns for ever
_UNPLACED = np.repeat([0.35, 0.3], 3)  # [rad], [m] a root whose sigmas are larger is not placed yet
_LEAST_LEVER_M = 0.01  # points nearer to an axis do not determine a rotation about it


class EquipmentSearch:
    """Searches the equipment.

    Args:
        equipment: its attachments and how upright it is.
        fit: of a start.
    """

    def __init__(self, equipment: Equipment, fit: EquipmentFit) -> None:
        self._equipment, self._fit, self._chain = equipment, fit, fit.chain
        endless = [j for j in self._chain.tree.tree_joints if j.type == "hinge" and j.limits is None]
        # Pedals follow the foot once their crank is found.
        turning = {joint.child for joint in endless}
        self._searched = next((joint.name for joint in endless if joint.parent not in turning), None)

    def nominal(self, world_T_root: Array, angle: float = 0.0) -> Array:
        """Poses (E, 4, 4) with all joints at zero, but the searched hinge at an angle [rad]."""
        motions = np.tile(np.eye(4), (len(self._chain.twists), 1, 1))
        if self._searched is not None:
            row = self._chain.tree.joint_row[self._searched]
            motions[row, :3, :3] = self._chain.tree.tree_joints[row].hinge_rotation(np.array(angle))
        return self._chain.tree.forward_kinematics(world_T_root, motions)

    def find(
        self, points: AttachedPoints, lengths: Array, root: tuple[Array, Array] | None = None
    ) -> tuple[Array, Array] | None:
        """Poses (E, 4, 4) and the root's sigmas (6) [rad], [m]; None while the points do not determine them.

        Args:
            points: measured at one time.
            lengths: (L) of the equipment [m].
            root: pose (4, 4) of the root and its sigmas (6), where a camera on it measured it.
        """
        if root is None and not attached(points):
            return None
        angles = [0.0] if self._searched is None else np.linspace(-np.pi, np.pi, _STARTS, endpoint=False).tolist()
        starts = [self._aligned(points, angle) if root is None else self.nominal(root[0], angle) for angle in angles]
        fits = [self._fit.solve(start[None], lengths, points, root) for start in starts]
        best = min(fits, key=lambda fitted: fitted.cost)
        if root is None and (best.root_sigmas > _UNPLACED)[self._determined(best.poses[0])].any():
            return None
        return best.poses[0], best.root_sigmas

    def _determined(self, poses: Array) -> NDArray[np.bool_]:
        """(6) rotations and translations of the root that move an attachment: not the turn of a bar about itself."""
        root_T_world = inverse(poses[self._chain.root])
        points = [
            transform_points(root_T_world @ poses[self._chain.row[each.equipment_segment]], each.on_equipment)
            for each in self._equipment.attachments
        ]
        about_axes = np.linalg.norm(np.cross(np.concatenate(points)[:, None], np.eye(3)), axis=2).max(axis=0)
        return np.append(about_axes > _LEAST_LEVER_M, np.ones(3, bool))

    def _aligned(self, points: AttachedPoints, angle: float) -> Array:
        """``nominal`` poses (E, 4, 4), moved as one to the body's points (Kabsch 1976)."""
        nominal = self.nominal(np.eye(4), angle)
        on_equipment, on_body, weights = [], [], []
        known = attached(points)
        for attachment in self._equipment.attachments:
            if attachment.name in known:
                pose = nominal[self._chain.row[attachment.equipment_segment]]
                on_equipment.append(transform_points(pose, attachment.on_equipment))
                on_body.append(points[attachment.name][0])
                unknown = float(np.max(attachment.unknown))
                weights.append(1.0 / (np.square(attachment.sigmas) + unknown**2 + BODY_M**2))
        a, b, w = np.concatenate(on_equipment), np.concatenate(on_body), np.concatenate(weights)
        a_mean, b_mean = w @ a / w.sum(), w @ b / w.sum()
        scatter = (b - b_mean).T @ ((a - a_mean) * w[:, None])
        R = nearest_rotation(scatter)
        if np.isfinite(self._equipment.upright_sigma):
            # Upright, it only turns about the vertical.
            R = exp_so3(np.array([0.0, 0.0, np.arctan2(scatter[1, 0] - scatter[0, 1], scatter[0, 0] + scatter[1, 1])]))
        return np.asarray(rigid(R, b_mean - R @ a_mean) @ nominal)
