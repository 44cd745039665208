"""Inverse kinematics: the configuration of a robot whose links are nearest to where they should be.

A quadratic program an instant and round (pink), with the limits of joints, of their speeds, and of what is between the
robot's own links as inequalities. Hands and feet count most.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.robot.links_apart import LinksApart
from bodycam_ros.robot.robot_model import FLOATING, JointBounds, Robot
from bodycam_ros.robot.scaled_person import LinkTarget, ScaledPerson
from bodycam_ros.settings import SettingsGroups, setting

_SOLVER = "daqp"
_DAMPING = 1e-6  # of all speeds, so that the program is convex
_PLACE, _END_PLACE, _TURN, _POSTURE = 0.5, 10.0, 0.2, 1e-2  # costs: of a metre, of a radian
_SHARES = (1.0, 0.5, 0.25, 0.1)
_TOUCH_M = 0.002  # links nearer than this touch
REACH = 0.98  # share of the robot's limbs that scaled motion uses: a stretched knee can only buckle
_ROUNDS = 2  # of inverse kinematics a frame; each starts where the one before ended
_FIRST_ROUNDS = 60  # from the N-pose, where any way is allowed


@dataclass(frozen=True)
class RetargetSettings:
    """How a robot follows."""

    clearance: float = setting(
        0.01,
        unit="m",
        limits=(0.0, 0.1),
        reason="least distance between the robot's own links; raise it for hulls that are too thin",
    )


@dataclass(frozen=True)
class RobotSettings(SettingsGroups):
    """Settings of robots."""

    retarget: RetargetSettings = RetargetSettings()


@dataclass(frozen=True, eq=False)
class RobotState:
    """A robot at an instant.

    Attributes:
        stamp_ns: the person's.
        world_T_root: (4, 4) of the link that all others of its URDF hang on [m].
        positions: (J,) of its joints [rad or m].
        velocities: (J,) since the instant before [rad/s or m/s].
        errors_m: hand or foot -> how far it is from where it should be.
        nearest_m: distance of its two nearest links that must stay apart; infinite where none are near.
        held: whether it stayed as it was, because no step keeps all limits.
    """

    stamp_ns: int
    world_T_root: Array
    positions: Array
    velocities: Array
    errors_m: Mapping[str, float]
    nearest_m: float
    held: bool


class Retargeting:
    """Lets a robot do what a person does, instant by instant.

    Args:
        body: the person.
        robot: that follows.
        settings: how.

    Raises:
        BodyError: as of ``ScaledPerson``.
    """

    def __init__(self, body: BodyModel, robot: Robot, settings: RetargetSettings) -> None:
        import pink
        import pinocchio
        from pink.tasks import PostureTask

        self._pink, self._pin = pink, pinocchio
        self._robot, self._settings = robot, settings
        self.imitate(body)
        self._bounds, self._apart = JointBounds(robot), LinksApart(robot, settings.clearance)
        self._posture = PostureTask(cost=_POSTURE)
        self._posture.set_target(robot.n_pose)
        self._tasks: dict[str, Any] = {}
        self._configuration: Any = None
        self._targets: Mapping[str, LinkTarget] = {}
        self._stamp_ns = 0

    @property
    def scale(self) -> float:
        """What the robot's ways through the world are of the person's."""
        return self._person.scale

    def imitate(self, body: BodyModel) -> None:
        """Follow another person from now on, or one who is known better.

        Raises:
            BodyError: as of ``ScaledPerson``.
        """
        self._person = ScaledPerson(body, self._robot, REACH)

    def follow(self, stamp_ns: int, world_T_segment: Array) -> RobotState:
        """The robot when the person is at poses (S, 4, 4), later than at the call before."""
        targets = self._person.targets(world_T_segment)
        if self._configuration is None:
            self._begin(targets)
            dt_s, rounds = np.inf, _FIRST_ROUNDS
        else:
            dt_s, rounds = 1e-9 * (stamp_ns - self._stamp_ns), _ROUNDS
        before = self._configuration.q.copy()
        self._bounds.begin(before, dt_s)
        held = False
        for share in np.minimum(1.0, np.arange(1, rounds + 1) / (rounds - 1 or 1)):
            self._aim(targets, float(share))
            held |= not self._step()
        self._stamp_ns, self._targets = stamp_ns, targets
        return self._state(stamp_ns, before, dt_s, targets, held)

    def _begin(self, targets: Mapping[str, LinkTarget]) -> None:
        """The robot in the N-pose, its root where it should be."""
        q = self._robot.n_pose.copy()
        placed = targets[self._robot.mapping.root].world_T_link @ self._robot.link_in_n_pose(self._robot.tree_root)
        q[:FLOATING] = self._pin.SE3ToXYZQUAT(self._pin.SE3(placed))
        model = self._robot.model
        self._configuration = self._pink.Configuration(model, model.createData(), q)

    def _aim(self, targets: Mapping[str, LinkTarget], share: float) -> None:
        """Send links a share of the way from where they should have been to where they should be.

        Whether links would meet is known to first order only, so no round should go far.
        """
        from pink.tasks import FrameTask

        for link, target in targets.items():
            if link not in self._tasks:
                place = _END_PLACE if target.is_end else _PLACE
                self._tasks[link] = FrameTask(
                    link,
                    position_cost=place if target.place_counts else 0.0,
                    orientation_cost=_TURN if target.turn_counts else 0.0,
                    lm_damping=1e-3,
                )
            before = self._targets.get(link, target).world_T_link
            way = log_se3(inverse(before) @ target.world_T_link)
            self._tasks[link].set_target(self._pin.SE3(before @ exp_se3(share * way)))

    def _step(self) -> bool:
        """One round; whether there is a step that keeps all limits."""
        from pink.exceptions import NoSolutionFound

        tasks = [*self._tasks.values(), self._posture]
        for self._apart.may_stay in (False, True):
            try:
                step = self._pink.solve_ik(
                    self._configuration, tasks, 1.0, _SOLVER, _DAMPING, limits=[self._bounds, self._apart]
                )
            except NoSolutionFound:
                continue
            return self._taken(step)
        return False

    def _taken(self, step: Array) -> bool:
        """Take a step, or the half, a quarter and so on of it: as much as brings no links too near; whether any was.

        That links stay apart holds to first order only: feet that turn beside each other meet with other corners.
        """
        before, least_m = self._configuration.q.copy(), min(self._apart.nearest(self._configuration), _TOUCH_M)
        for share in _SHARES:
            self._configuration.update(self._pin.integrate(self._robot.model, before, share * step))
            if self._apart.nearest(self._configuration) >= least_m:
                return True
        self._configuration.update(before)
        return False

    def _state(
        self, stamp_ns: int, before: Array, dt_s: float, targets: Mapping[str, LinkTarget], held: bool
    ) -> RobotState:
        positions = np.clip(self._configuration.q[FLOATING:], self._robot.lowest, self._robot.highest)
        return RobotState(
            stamp_ns,
            self._pose_of(self._robot.tree_root),
            positions,
            (positions - before[FLOATING:]) / dt_s,
            {
                link: float(np.linalg.norm((self._pose_of(link) - target.world_T_link)[:3, 3]))
                for link, target in targets.items()
                if target.is_end
            },
            self._apart.nearest(self._configuration),
            held,
        )

    def _pose_of(self, link: str) -> Array:
        pose: Array = self._configuration.get_transform_frame_to_world(link).homogeneous
        return pose
