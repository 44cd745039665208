"""A body and its equipment as one tree with loops, the constraint rows of the loops, and their solution (B 3.2).

An unknown length of the equipment is a sliding joint (``body_with_lengths``). A configuration is the motions
(1 + J, 4, 4) of the root and of all joints of the tree.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import body_with_lengths, length_joint
from bodycam_ros.body.equipment import Equipment, unknown_lengths
from bodycam_ros.geometry import Array, hat, log_jacobian, log_so3
from bodycam_ros.kinematics.joint_angles import JointLimits
from bodycam_ros.kinematics.tangent import GIVES_M, GIVES_RAD, LoopGaps, TreeTangent, held_rows

_LIMB_M = 0.4  # a column that slides by this counts as one that turns by a radian
_POSTURE_RAD, _LEAN_RAD, _LIMIT_RAD = 1.0, 0.5, 0.03  # sigmas of joints' rotations, of the root's, and beyond limits
CLOSED_SIGMAS = 3.0  # a loop that is strained less is closed
_GIVEN_M = 1e-3  # a given length is right to a millimetre
_BEYOND_RAD = np.radians(10.0) / CLOSED_SIGMAS  # no joint is bent farther than 10 deg beyond its limits
_WEAK = 0.03  # weight of a loop that is only to come near: enough to stretch an arm, too little to tear a foot off
_LONG = 60  # steps of a descent to the end
_LONGEST_STEP = 0.6  # [rad], or of a limb's length
_LEAST_DAMPING, _FIRST_DAMPING, _MOST_DAMPING = 1e-9, 1e-3, 1e6
_FLOOR = 1e-3  # of the mean of the diagonal: damps columns that no row moves
_CONVERGED = 1e-5  # relative decrease of the cost


@dataclass(frozen=True, eq=False)
class Rows:
    """Constraint rows in units of sigma.

    Attributes:
        owners: (R) the joint, or the segment on the ground, of each row.
        residuals: (R).
        jacobian: (R, K).
    """

    owners: NDArray[np.str_]
    residuals: Array
    jacobian: Array


class Mechanism:
    """Columns and rows of a body, with equipment or alone.

    Args:
        body: both as one (``coupled_body``).
        equipment: as far as it fits the body, or None.

    Attributes:
        body, equipment: as given.
        tree: the body with a sliding joint for what is unknown of each place (``body_with_lengths``).
        loops: joint or attachment -> the joint that closes a loop.
        lengths: joint or attachment of unknown place -> (3) sigmas in the axes of the equipment's segment [m].
        columns: root segment or joint -> its columns, those of unknown lengths apart.
        units: (K) 1 for a rotation, a limb's length [m] for a translation: in these units columns are alike.
        grounded: segments of the equipment that do not move in the world.
        only_upright: whether the equipment's root may move, but not lean.
    """

    def __init__(self, body: BodyModel, equipment: Equipment | None = None) -> None:
        self.body = body
        self.equipment = equipment
        self.grounded = body.standing
        self.only_upright = (
            equipment is not None and equipment.upright_sigma < GIVES_RAD and equipment.root not in self.grounded
        )
        self.tree = body if equipment is None else body_with_lengths(body, equipment)
        self.lengths = {} if equipment is None else unknown_lengths(equipment)
        self._length_rows = {name: self.tree.joint_row[length_joint(name)] for name in self.lengths}
        self.tangent = TreeTangent(self.tree, GIVES_M)
        self.limits = JointLimits(self.tree)
        self.loops = {joint.name: joint for joint in self.tree.loop_joints}
        self._gaps = LoopGaps(self.tree, self.tree.loop_joints)
        slides: list[NDArray[np.bool_]] = [np.repeat([False, True], 3)]
        self.columns: dict[str, NDArray[np.intp]] = {body.root: np.arange(6)}
        of_lengths = {length_joint(name) for name in self.lengths}
        for joint, xi, own in zip(self.tree.tree_joints, self.tangent.twists, self.tangent.columns, strict=True):
            slides.append(np.asarray(xi[3:].any(axis=0)))
            if joint.name not in of_lengths:
                self.columns[joint.name] = np.arange(own.start, own.stop)
        self.units = np.where(np.concatenate(slides), _LIMB_M, 1.0)
        self._fixed = {*of_lengths, *(joint.name for joint in (equipment.joints if equipment else ()))}

    @property
    def moving(self) -> NDArray[np.intp]:
        """Indices of all columns but those of unknown lengths."""
        return np.concatenate(list(self.columns.values()))

    def resting(self, bent: float = 0.0) -> Array:
        """The N-pose, or joints bent by a share of the way to the middle of their limits; the roots at one place."""
        configuration = np.tile(np.eye(4), (1 + len(self.tree.tree_joints), 1, 1))
        configuration[1:, :3, :3] = self.limits.middle(bent)
        return configuration

    def length_errors(self, configuration: Array) -> dict[str, Array]:
        """Unknown length -> by how much (3) it exceeds the given one, in the axes of the equipment's segment [m]."""
        return {name: configuration[1 + row, :3, 3] for name, row in self._length_rows.items()}

    def constraints(self, configuration: Array, without: Collection[str] = (), ground: bool = False) -> Rows:
        """Rows of the loops but some, and of equipment that may not lean.

        Args:
            configuration: where the rows are linearised.
            without: loops that are left out.
            ground: whether what stands in the world is fixed where it is; else it is only kept upright.
        """
        poses = self.tree.poses_of(configuration)
        J, index = self.tangent.segment_jacobians(poses), self.tree.segment_index
        owners: list[str] = []
        residuals, jacobians = [np.zeros(0)], [np.zeros((0, self.tangent.count))]

        def add(owner: str, errors: Array, jacobian: Array) -> None:
            owners.extend([owner] * len(errors))
            residuals.append(errors)
            jacobians.append(jacobian)

        gaps, by_step = self._gaps.linearised(poses, J)
        gaps, by_step = gaps / self._gaps.sigmas, by_step / self._gaps.sigmas[..., None]
        for row, (name, joint) in enumerate(self.loops.items()):
            if name not in without:
                held = list(held_rows(joint))
                add(name, gaps[row, held], by_step[row, held])
        for segment in self.grounded if ground else ():
            add(segment, np.zeros(6), J[index[segment]])
        equipment = self.equipment
        if equipment is not None and (self.only_upright or (self.grounded and not ground)):
            row, sigma = index[equipment.root], equipment.upright_sigma
            up = poses[row, 2, :3]
            add(equipment.root, up[:2] / sigma, (hat(up) @ J[row, :3])[:2] / sigma)
        return Rows(np.array(owners, np.str_), np.concatenate(residuals), np.concatenate(jacobians))

    def priors(self, configuration: Array) -> tuple[Array, Array]:
        """Posture, limits and lengths: residuals in sigmas, and their Jacobian."""
        motion = configuration[1:]
        twists = self.tangent.twists
        columns = self.tangent.columns
        residuals, jacobians = [], []

        def add(values: Array, own: slice, jacobian: Array, sigma: Array | float) -> None:
            block = np.zeros((len(values), self.tangent.count))
            block[:, own] = jacobian / np.reshape(sigma, (-1, 1))
            residuals.append(values / sigma)
            jacobians.append(block)

        lean = log_so3(configuration[0, :3, :3])
        add(lean, slice(0, 3), log_jacobian(-lean), _LEAN_RAD)
        turned = log_so3(motion[:, :3, :3])
        by_turn = log_jacobian(-turned)
        for row, joint in enumerate(self.tree.tree_joints):
            if joint.type != "free" and joint.name not in self._fixed:
                add(turned[row], columns[row], by_turn[row] @ twists[row][:3], _POSTURE_RAD)
        angles = self.limits.nearest_angles(motion)
        excess, rates = self.limits.excess(angles), self.limits.angles.rates(angles)
        for angle in np.flatnonzero(excess):
            row = self.limits.angles.joint_rows[angle]
            add(excess[[angle]], columns[row], rates[[angle]] @ twists[row][:3], _LIMIT_RAD)
        for name, error in self.length_errors(configuration).items():
            row, unknown = self._length_rows[name], self.lengths[name] > 0.0
            add(error[unknown], columns[row], twists[row][3:][unknown], self.lengths[name][unknown])
        return np.concatenate(residuals), np.vstack(jacobians)

    def strains(self, configuration: Array) -> dict[str, float]:
        """Loop -> what it takes to close it, in sigmas.

        The root of three squares: of its worst row, of the unknown length in it that is farthest from what is given,
        and of the joint in it that is farthest beyond its limits. A place a little too far away is reached a little in
        each of these ways.
        """
        rows, count = self.constraints(configuration), len(self.tree.tree_joints)
        longer, bent = np.zeros(count), np.zeros(count)
        for name, error in self.length_errors(configuration).items():
            longer[self._length_rows[name]] = np.abs(error / np.maximum(self.lengths[name], _GIVEN_M)).max()
        excess = self.limits.excess(self.limits.nearest_angles(configuration[1:]))
        np.maximum.at(bent, self.limits.angles.joint_rows, np.abs(excess) / _BEYOND_RAD)
        strains = {}
        for name, joint in self.loops.items():
            parent, child = (self.tree.moves[self.tree.segment_index[end]] for end in (joint.parent, joint.child))
            worst = np.abs(rows.residuals[rows.owners == name]).max(initial=0.0)
            strains[name] = float(np.hypot(worst, np.hypot(longer, bent)[parent ^ child].max(initial=0.0)))
        return strains

    def open_loops(self, configuration: Array) -> set[str]:
        """Loops that a configuration does not close."""
        return {name for name, strain in self.strains(configuration).items() if strain > CLOSED_SIGMAS}

    def gap(self, configuration: Array, loop: str) -> tuple[float, float]:
        """How far a loop is open: [m], the worst of an attachment's points, and [rad]."""
        joint = self.loops[loop]
        poses = self.tree.poses_of(configuration)
        index = self.tree.segment_index
        parent, child = poses[index[joint.parent]], poses[index[joint.child]]
        error = self._gaps.jacobians(poses)[0][list(self.loops).index(loop)]
        attachments = () if self.equipment is None else self.equipment.attachments
        points = [each.distances(child, parent).max() for each in attachments if each.name == loop]
        return float(points[0] if points else np.linalg.norm(error[3:])), float(np.linalg.norm(error[:3]))


def project(mechanism: Mechanism, start: Array, columns: NDArray[np.intp], without: Collection[str] = ()) -> Array:
    """The configuration near another that closes all loops but some, to rounding if the chosen columns can."""

    def linearise(configuration: Array) -> tuple[Array, Array, float]:
        rows = mechanism.constraints(configuration, without)
        return rows.residuals, rows.jacobian, float(rows.residuals @ rows.residuals)

    return _descend(mechanism, start, linearise, columns, _LONG)[0]


def solve(
    mechanism: Mechanism,
    start: Array,
    without: Collection[str] = (),
    weak: Collection[str] = (),
    columns: NDArray[np.intp] | None = None,
    kernel: float = np.inf,
    steps: int = _LONG,
) -> tuple[Array, float]:
    """Loops closed but some, others only near; joints within limits, lengths and posture near what is given.

    A loop whose rows are ``kernel`` sigmas off in all counts half (Geman-McClure).

    Returns:
        The configuration and its cost.
    """

    def linearise(configuration: Array) -> tuple[Array, Array, float]:
        rows = mechanism.constraints(configuration, without)
        priors, by_priors = mechanism.priors(configuration)
        weights, cost = np.ones(len(rows.owners)), float(priors @ priors)
        for name in mechanism.loops:
            own = rows.owners == name
            square, weight = float(np.sum(rows.residuals[own] ** 2)), _WEAK**2 if name in weak else 1.0
            share = 1.0 if np.isinf(kernel) else kernel**2 / (kernel**2 + square)
            weights[own] = np.sqrt(weight) * share
            cost += weight * square * share
        J = np.vstack([weights[:, None] * rows.jacobian, by_priors])
        return np.concatenate([weights * rows.residuals, priors]), J, cost

    chosen = np.arange(mechanism.tangent.count) if columns is None else columns
    return _descend(mechanism, start, linearise, chosen, steps)


def _descend(
    mechanism: Mechanism,
    start: Array,
    linearise: Callable[[Array], tuple[Array, Array, float]],
    columns: NDArray[np.intp],
    steps: int,
) -> tuple[Array, float]:
    """The configuration after so many steps that lower the cost, and its cost (Levenberg-Marquardt).

    Args:
        mechanism: whose columns move.
        start: the first configuration.
        linearise: residuals (R), Jacobian (R, K) and cost; weights of a robust cost are in the first two.
        columns: that are moved.
        steps: at most.
    """
    units = mechanism.units[columns]
    damping = _FIRST_DAMPING
    state = start
    residuals, J, cost = linearise(state)
    for _ in range(steps):
        J = J[:, columns] * units
        hessian = J.T @ J
        gradient = J.T @ residuals
        before = cost
        if not (cost and len(gradient)):
            break
        scale = np.diag(hessian) + _FLOOR * np.trace(hessian) / len(hessian)
        while damping < _MOST_DAMPING:
            step = -np.linalg.solve(hessian + np.diag(damping * scale), gradient)
            step *= min(1.0, _LONGEST_STEP / max(float(np.abs(step).max()), 1e-12))
            increment = np.zeros(mechanism.tangent.count)
            increment[columns] = units * step
            tried = mechanism.tangent.moved(state, increment)
            system = linearise(tried)
            if system[2] < cost:
                state, (residuals, J, cost) = tried, system
                damping = max(0.2 * damping, _LEAST_DAMPING)
                break
            damping *= 5.0
        if before - cost <= _CONVERGED * before:
            break
        damping = min(damping, 0.1 * _MOST_DAMPING)
    return state, cost
