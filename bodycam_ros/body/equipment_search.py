"""The equipment's pose by the body's attached points, and a posture in which all loops of body and equipment close.

Hinges that turn for ever are searched. Attachments that contradict others are released, not met half-way.
"""

from collections.abc import Collection

import numpy as np

from bodycam_ros.body.mechanism import Mechanism, solve
from bodycam_ros.geometry import Array, exp_so3, inverse, nearest_rotation, rigid, transform_points

_STARTS = 8  # initial angles of a hinge that turns for ever
_KERNEL = 10.0  # sigmas at which an attachment counts half: a prediction may be as far off
_UNPLACED = np.repeat([0.35, 0.3], 3)  # [rad], [m] a root whose sigmas are larger is not placed yet
_LEAST_LEVER_M = 0.01  # points nearer to an axis do not determine a rotation about it
_STEPS = 20  # from each start
_BENT = 0.6, 0.9, 0.3
"""How far a joint begins on the way to the middle of its limits; the next one where loops stay open.

A straight knee has no direction in which to bend; limits make minima that another start does not have.
"""

_STIFFENING = 1e-6  # added to information, so that it has an inverse


class EquipmentSearch:
    """Searches the equipment; the body stays where it is.

    Args:
        mechanism: the body with its equipment.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        equipment = mechanism.equipment
        assert equipment is not None  # by the caller
        self._mechanism = mechanism
        self._equipment = equipment
        self._tree = mechanism.tree
        self._root_row = self._tree.joint_row[equipment.name]
        beside = self._tree.equipment_segments
        own = [row for row, joint in enumerate(self._tree.tree_joints) if joint.parent in beside]
        columns = [mechanism.tangent.columns[row] for row in (self._root_row, *own)]
        self._columns = np.concatenate([np.arange(each.start, each.stop) for each in columns])
        endless = [j for j in equipment.joints if j.type == "hinge" and j.limits is None]
        # Pedals follow the foot once their crank is found.
        turning = {joint.child for joint in endless}
        self._searched = next((joint for joint in endless if joint.parent not in turning), None)

    def find(self, start: Array, measured: Collection[str], is_root_measured: bool) -> Array | None:
        """The configuration with the equipment where it fits best; None while the attachments do not determine it.

        Args:
            start: the body where it is measured.
            measured: attachments whose points are.
            is_root_measured: whether a camera measured the root, which then stays where it is.
        """
        without = [name for name in self._mechanism.loops if name not in measured]
        if not (measured or is_root_measured):
            return None
        best = self.ranked(start, measured, without, is_root_measured)[0]
        return best if is_root_measured or self._is_determined(best, without) else None

    def ranked(
        self, start: Array, measured: Collection[str], without: Collection[str], is_root_measured: bool
    ) -> list[Array]:
        """Configurations with the equipment near some attachments, those that fit best first.

        Args:
            start, measured, is_root_measured: as ``find``.
            without: loops that are left out.
        """
        columns = self._columns[6:] if is_root_measured else self._columns
        angles = [0.0] if self._searched is None else np.linspace(-np.pi, np.pi, _STARTS, endpoint=False).tolist()
        starts = [self._start(start, measured, angle, is_root_measured) for angle in angles]
        solved = [
            solve(self._mechanism, each, without, columns=columns, kernel=_KERNEL, steps=_STEPS) for each in starts
        ]
        return [configuration for configuration, _ in sorted(solved, key=lambda pair: pair[1])]

    def _is_determined(self, found: Array, without: Collection[str]) -> bool:
        """Whether the root is known, apart from turns that move no attachment, as of a bar about itself."""
        rows = self._mechanism.constraints(found, without)
        J = np.vstack([rows.jacobian, self._mechanism.priors(found)[1]])[:, self._columns]
        covariance = np.linalg.inv(J.T @ J + _STIFFENING * np.eye(J.shape[1]))[:6, :6]
        points = np.concatenate(list(self._points(found).values()))
        levers = np.linalg.norm(np.cross(points[:, None], np.eye(3)), axis=2).max(axis=0)
        matters = np.append(levers > _LEAST_LEVER_M, np.ones(3, bool))
        return not (np.sqrt(np.diag(covariance)) > _UNPLACED)[matters].any()

    def _points(self, configuration: Array) -> dict[str, Array]:
        """Attachment -> (N, 3) its points on the equipment, in the root's frame [m]."""
        poses, index = self._tree.poses_of(configuration), self._tree.segment_index
        root_T_segment = inverse(poses[index[self._equipment.root]]) @ poses
        parents = {name: index[joint.parent] for name, joint in self._mechanism.loops.items()}
        return {
            each.name: transform_points(root_T_segment[parents[each.name]], each.on_equipment)
            for each in self._equipment.attachments
        }

    def _start(self, start: Array, measured: Collection[str], angle: float, is_root_measured: bool) -> Array:
        """The equipment's own joints at zero, the searched one at an angle [rad], moved to the body (Kabsch 1976)."""
        motion, tree = start.copy(), self._tree
        for joint in self._equipment.joints:
            if joint.name in tree.joint_row:
                motion[1 + tree.joint_row[joint.name]] = np.eye(4)
        if self._searched is not None:
            motion[1 + tree.joint_row[self._searched.name], :3, :3] = self._searched.hinge_rotation(np.array(angle))
        if is_root_measured:
            return motion
        points, poses = self._points(motion), tree.poses_of(start)
        known = [each for each in self._equipment.attachments if each.name in measured]
        a = np.concatenate([points[each.name] for each in known])
        body = [transform_points(poses[tree.segment_index[each.body_segment]], each.on_body) for each in known]
        b = np.concatenate(body)
        w = np.concatenate([1.0 / (np.square(each.sigmas) + float(np.max(each.unknown)) ** 2) for each in known])
        a_mean, b_mean = w @ a / w.sum(), w @ b / w.sum()
        scatter = (b - b_mean).T @ ((a - a_mean) * w[:, None])
        R = nearest_rotation(scatter)
        if np.isfinite(self._equipment.upright_sigma):
            # Upright, it only turns about the vertical.
            R = exp_so3(np.array([0.0, 0.0, np.arctan2(scatter[1, 0] - scatter[0, 1], scatter[0, 0] + scatter[1, 1])]))
        world_T_root = rigid(R, b_mean - R @ a_mean)
        motion[1 + self._root_row] = inverse(start[0]) @ world_T_root
        return motion


def close_loops(mechanism: Mechanism) -> tuple[Array, set[str]]:
    """A configuration that closes as many loops as can be closed together, and the loops that it leaves open."""
    solutions: list[tuple[Array, float]] = []
    for bent in _BENT:
        start = mechanism.resting(bent)
        starts = [start]
        if mechanism.equipment is not None:
            attachments = [each.name for each in mechanism.equipment.attachments]
            starts = EquipmentSearch(mechanism).ranked(start, attachments, (), False)[:2]
        # A person sits on a bicycle in the posture that bends the least.
        solutions.append(min((solve(mechanism, start) for start in starts), key=lambda pair: pair[1]))
        if not mechanism.open_loops(solutions[-1][0]):
            return solutions[-1][0], set()
    best = min(solutions, key=lambda pair: pair[1])[0]
    left_open: set[str] = set()
    while opened := mechanism.open_loops(best) - left_open:
        left_open.add(max(opened, key=mechanism.strains(best).__getitem__))
        best = solve(mechanism, best, without=left_open)[0]
    for name in sorted(left_open, key=lambda name: mechanism.gap(best, name)[0]):
        tried = solve(mechanism, best, without=left_open - {name})[0]
        if mechanism.open_loops(tried) <= left_open - {name}:
            left_open, best = left_open - {name}, tried
    if left_open:
        best = solve(mechanism, best, without=left_open)[0]
        left_open |= mechanism.open_loops(best)
    return best, left_open
