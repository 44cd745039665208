"""Levenberg-Marquardt on a mechanism: loops closed, joints within limits, lengths and posture near what is said."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, log_so3
from bodycam_ros.kinematics.joint_gap import turn_jacobian
from bodycam_ros.mobility.angle_limits import AngleLimits
from bodycam_ros.mobility.mechanism import Configuration, Mechanism

_POSTURE_RAD, _LEAN_RAD = 1.0, 0.5  # how far joints are bent, and the root leans, from the N-pose
_LIMIT_RAD = 0.03
_KNOWN_M = 1e-6
_WEAK = 0.03  # of what is only to come near: enough to stretch an arm, too little to tear a foot off
_LEAST_DAMPING, _FIRST_DAMPING, _MOST_DAMPING = 1e-9, 1e-3, 1e6
_LONGEST_STEP = 0.6  # [rad], or of a limb's length
_ENOUGH = 1e-5  # relative decrease of the cost


class Descent:
    """Goes down from a configuration."""

    def __init__(
        self,
        mechanism: Mechanism,
        columns: NDArray[np.int_],
        without: Collection[str] = (),
        weak: Collection[str] = (),
    ) -> None:
        """Prepare.

        Args:
            mechanism: body and equipment.
            columns: that may move.
            without: loops that count nothing.
            weak: loops that count little.
        """
        self._mechanism = mechanism
        self._columns, self._without, self._weak = columns, set(without), set(weak)
        self._limits = AngleLimits(mechanism.body)
        equipment = mechanism.equipment
        own = set() if equipment is None else {joint.name for joint in equipment.joints}
        moving = [freedom for freedom in mechanism.freedoms[1:] if freedom.columns.start in columns]
        row_of = {joint.name: row for row, joint in enumerate(mechanism.body.tree_joints)}
        self._bent = {row_of[f.name]: f for f in moving if f.kind == "joint" and f.name not in own}
        self._lengths = [freedom for freedom in moving if freedom.kind == "length"]

    def run(self, start: Configuration, steps: int, kernel: float = np.inf) -> tuple[Configuration, float]:
        """The configuration after so many steps, and its cost.

        Args:
            start: where to begin.
            steps: at most.
            kernel: [sigma] of a whole loop, at which it counts half (Geman-McClure); infinite: not robust.
        """
        units = self._mechanism.column_units[self._columns]
        configuration, damping = start, _FIRST_DAMPING
        residuals, J, cost = self._system(configuration, kernel)
        for _ in range(steps):
            A = J[:, self._columns] * units
            hessian, gradient = A.T @ A, A.T @ residuals
            before = cost
            while damping < _MOST_DAMPING:
                damped = hessian + np.diag(damping * (np.diag(hessian) + 1e-3 * np.trace(hessian) / len(hessian)))
                step = -np.linalg.solve(damped, gradient)
                step *= min(1.0, _LONGEST_STEP / max(float(np.abs(step).max()), 1e-12))
                full = np.zeros(self._mechanism.column_count)
                full[self._columns] = units * step
                tried = self._mechanism.moved(configuration, full)
                system = self._system(tried, kernel)
                if system[2] < cost:
                    configuration, (residuals, J, cost) = tried, system
                    damping = max(0.2 * damping, _LEAST_DAMPING)
                    break
                damping *= 5.0
            if before - cost < _ENOUGH * before:
                break
            damping = min(damping, 0.1 * _MOST_DAMPING)
        return configuration, cost

    def _system(self, configuration: Configuration, kernel: float) -> tuple[Array, Array, float]:
        """Weighted residuals (R) and Jacobian (R, K), and the cost."""
        rows = self._mechanism.loop_rows(configuration)
        squares = dict.fromkeys(rows.owners, 0.0)
        for owner, residual in zip(rows.owners, rows.residuals, strict=True):
            squares[owner] += float(residual) ** 2
        weight_of, cost = {}, 0.0
        for owner, square in squares.items():
            counts = 0.0 if owner in self._without else _WEAK**2 if owner in self._weak else 1.0
            share = 1.0 if np.isinf(kernel) else kernel**2 / (kernel**2 + square)
            weight_of[owner] = np.sqrt(counts) * share
            cost += counts * square * share
        weights = np.array([weight_of[owner] for owner in rows.owners])
        upright = self._mechanism.upright_rows(configuration)
        expected, J_expected = self._expectations(configuration)
        others = np.concatenate([upright.residuals, expected])
        residuals = np.concatenate([weights * rows.residuals, others])
        J = np.vstack([weights[:, None] * rows.jacobian, upright.jacobian, J_expected])
        return residuals, J, cost + float(others @ others)

    def _expectations(self, configuration: Configuration) -> tuple[Array, Array]:
        """Posture, limits and lengths: residuals in sigmas, and their Jacobian."""
        mechanism = self._mechanism
        residuals, blocks = [], []

        def add(values: Array, columns: slice, by_columns: Array, sigma: Array | float) -> None:
            block = np.zeros((len(values), mechanism.column_count))
            block[:, columns] = by_columns / np.reshape(sigma, (-1, 1))
            residuals.append(values / sigma)
            blocks.append(block)

        root = mechanism.freedoms[0].columns
        lean = log_so3(configuration.world_T_root[:3, :3])
        add(lean, slice(root.start, root.start + 3), turn_jacobian(lean), _LEAN_RAD)
        for row, freedom in self._bent.items():
            bent = log_so3(configuration.joint_motion[row, :3, :3])
            turns = mechanism.tangents_of_joints[row][:3]
            add(bent, freedom.columns, turn_jacobian(bent) @ turns, _POSTURE_RAD)
        for row, excess, by_turn in self._limits.excess(configuration.joint_motion) if self._bent else ():
            if row in self._bent:
                turns = mechanism.tangents_of_joints[row][:3]
                add(excess, self._bent[row].columns, by_turn @ turns, _LIMIT_RAD)
        for freedom in self._lengths:
            sigmas = np.maximum(mechanism.length_sigmas[freedom.name], _KNOWN_M)
            add(mechanism.longer_by(configuration, freedom.name), freedom.columns, np.eye(3), sigmas)
        return np.concatenate(residuals), np.vstack(blocks)
