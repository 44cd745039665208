"""The equipment's initial pose, from what the body holds of it at one time; hinges that turn for ever are searched."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body_state import SegmentPose
from bodycam_ros.estimation.equipment_fit import BODY_M, EquipmentFit, HeldPoints, Prior
from bodycam_ros.geometry import Array, exp_so3, inverse, nearest_rotation, rigid, transform_points

_STARTS = 12  # initial angles of a hinge that turns for ever
_UNPLACED = np.repeat([0.35, 0.3], 3)  # [rad], [m] a root whose sigmas are larger is not placed yet
_STEPS_NEAR = 6
_LOOSE = 10.0  # [rad], [m] no prior
_LEAST_LEVER_M = 0.01  # points nearer to an axis do not determine a rotation about it


class EquipmentPlace:
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
        searched = [joint.name for joint in endless if joint.parent not in turning]
        self._searched: list[str | None] = [*searched] or [None]
        self._turning_rows = [self._chain.row[name] for name in turning]

    def nominal(self, world_T_root: Array, hinge: str | None = None, angle: float = 0.0) -> Array:
        """Poses (E, 4, 4) with all joints at zero, but one hinge at an angle [rad]."""
        motions = np.tile(np.eye(4), (len(self._chain.twists), 1, 1))
        return self._chain.with_hinge(world_T_root, motions, hinge, angle)

    def find(self, held: HeldPoints, lengths: Array) -> tuple[Array, Array] | None:
        """Poses (E, 4, 4) and the root's sigmas (6) [rad], [m]; None while the held points do not determine them."""
        if not any(holds[0] for holds in held.holds.values()):
            return None
        hinge = self._searched[0]
        starts = [self._aligned(held, hinge, angle) for angle in _angles(hinge)]
        best = min((self._fit.solve(start[None], lengths, held) for start in starts), key=lambda fitted: fitted.cost)
        if (best.root_sigmas > _UNPLACED)[self._determined(best.poses[0])].any():
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

    def find_by_cameras(self, held: HeldPoints, lengths: Array, own: Sequence[SegmentPose]) -> tuple[Array, Array]:
        """As ``find``, by cameras on its root."""
        surest = min(own, key=lambda pose: float(np.trace(pose.covariance)))
        sigmas = np.full((len(self._chain.row), 6), _LOOSE)
        sigmas[self._chain.root] = np.sqrt(np.diag(surest.covariance))
        prior = Prior(self.nominal(surest.world_T_segment), sigmas)
        return self.search(held, lengths, prior), sigmas[self._chain.root]

    def refine(self, held: HeldPoints, lengths: Array, prior: Prior) -> Array:
        """Poses (E, 4, 4) fitted from a prediction."""
        if not any(holds[0] for holds in held.holds.values()):
            return prior.poses.copy()
        return np.asarray(self._fit.solve(prior.poses[None], lengths, held, prior, _STEPS_NEAR).poses[0])

    def search(self, held: HeldPoints, lengths: Array, prior: Prior) -> Array:
        """As ``refine``, but hinges that turn for ever may be anywhere."""
        sigmas, poses = prior.sigmas.copy(), prior.poses
        sigmas[self._turning_rows] = _LOOSE
        for hinge in self._searched:
            motions = self._chain.tree.joint_poses(poses, self._chain.slides)
            starts = [self._chain.with_hinge(poses[self._chain.root], motions, hinge, a) for a in _angles(hinge)]
            fits = [self._fit.solve(start[None], lengths, held, Prior(prior.poses, sigmas)) for start in starts]
            poses = min(fits, key=lambda fitted: fitted.cost).poses[0]
        return poses

    def _aligned(self, held: HeldPoints, hinge: str | None, angle: float) -> Array:
        """Poses (E, 4, 4) with joints at zero but one hinge, moved as one to the held points (Kabsch 1976)."""
        nominal = self.nominal(np.eye(4), hinge, angle)
        on_equipment, on_body, weights = [], [], []
        for attachment in self._equipment.attachments:
            if held.holds[attachment.name][0]:
                pose = nominal[self._chain.row[attachment.equipment_segment]]
                on_equipment.append(transform_points(pose, attachment.on_equipment))
                on_body.append(held.points[attachment.name][0])
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


def _angles(hinge: str | None) -> list[float]:
    return [0.0] if hinge is None else np.linspace(-np.pi, np.pi, _STARTS, endpoint=False).tolist()
