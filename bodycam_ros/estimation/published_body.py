"""What is published of a solved state: the person's segments and joints, with how uncertain they are."""

from dataclasses import replace

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyState
from bodycam_ros.estimation.coordinates import Coordinates
from bodycam_ros.estimation.coupling import Coupling
from bodycam_ros.estimation.solved_state import SolvedState
from bodycam_ros.estimation.uncertainty import body_uncertainty, widened
from bodycam_ros.geometry import Array


class PublishedBody:
    """Makes published states of solved ones.

    Unknown lengths of equipment are joints that slide; their segments come last, and are not published.

    Args:
        body: as it is published.
        solved: as it is solved, with these joints.
        coupling: of the body to equipment, if any.

    Attributes:
        segments: how many are published.
    """

    def __init__(self, body: BodyModel, solved: BodyModel, coupling: Coupling | None) -> None:
        self.segments = len(body.segments)
        self._names = solved.segments[: self.segments]
        self._joints = [solved.joint_row[joint.name] for joint in body.tree_joints]
        self._coupling = coupling

    def state(self, solved: SolvedState, at: Coordinates, covariance: Array) -> BodyState:
        """The published state.

        Args:
            solved: a state.
            at: its coordinates now.
            covariance: (2K, 2K) of velocities, then coordinates.
        """
        rows = slice(self.segments)
        uncertainty = solved.static.widen(body_uncertainty(at, covariance))
        if not solved.converged:
            uncertainty = widened(uncertainty)
        joints, segments = uncertainty.joints[self._joints], uncertainty.segments[rows]
        return BodyState(
            stamp_ns=solved.stamp_ns,
            segments=self._names,
            world_T_segment=at.poses[rows].copy(),
            twists=(at.jacobians @ at.velocity)[rows],
            uncertainty=replace(uncertainty, joints=joints, segments=segments),
            observed=solved.observed[rows],
            cameras_used=solved.cameras_used,
            converged=solved.converged,
            equipment=self._coupling.report(at, covariance, solved.active) if self._coupling else None,
        )
