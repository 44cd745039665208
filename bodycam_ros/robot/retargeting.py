"""Inverse kinematics: the configuration of a robot whose links are nearest to their targets.

A quadratic program per state and round (pink), with limits of joints, speeds and self-collision as inequalities. Hands
and feet have the largest weight.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, exp_se3, inverse, log_se3
from bodycam_ros.robot.robot_model import FLOATING, JointBounds, Robot
from bodycam_ros.robot.scaled_person import LinkTarget, ScaledPerson

_SOLVER = "daqp"
_DAMPING = 1e-6  # of all speeds, so that the program is convex
_PLACE, _END_PLACE, _TURN, _POSTURE = 0.5, 10.0, 0.2, 1e-2  # costs: of a metre, of a radian
_SHARES = (1.0, 0.5, 0.25, 0.1)
_CLEARANCE_M = 0.01  # least distance between the robot's own links
_TOUCH_M = 0.002  # links nearer than this touch
_BACK_M = 0.005  # largest increase per step of a distance below the clearance: more might be infeasible
_NEAR_M, _MOST_NEAR = 0.15, 20  # links that are kept apart until the next state, and how many pairs of them in a step
_SOON_S = 0.1  # within which links do not come nearer by that
REACH = 0.98  # share of the robot's limbs that scaled motion uses: a stretched knee can only buckle
_ROUNDS = 2  # of inverse kinematics a frame; each starts where the one before ended
_FIRST_ROUNDS = 60  # from the N-pose, where any way is allowed


@dataclass(frozen=True, eq=False)
class RobotState:
    """State of a robot.

    Attributes:
        stamp_ns: the person's.
        world_T_root: (4, 4) of the root link of its URDF [m].
        positions: (J,) of its joints [rad or m].
        velocities: (J,) since the state before [rad/s or m/s].
        errors_m: hand or foot -> distance from its target.
        nearest_m: distance of its two nearest links that must stay apart; infinite where none are near.
        blocked: whether it did not move, because no step satisfies all limits.
    """

    stamp_ns: int
    world_T_root: Array
    positions: Array
    velocities: Array
    errors_m: Mapping[str, float]
    nearest_m: float
    blocked: bool


class Retargeting:
    """Inverse kinematics of a robot that follows a person, state by state.

    Args:
        body: the person.
        robot: that follows.

    Raises:
        BodyError: as of ``ScaledPerson``.
    """

    def __init__(self, body: BodyModel, robot: Robot) -> None:
        import pink
        import pinocchio
        from pink.tasks import PostureTask

        self._pink, self._pin = pink, pinocchio
        self._robot = robot
        self.set_person(body)
        self._bounds = JointBounds(robot)
        self._all, self._near = pinocchio.GeometryData(robot.hulls), robot.hulls.copy()
        self._barriers: list[list[Any]] = []
        self._posture = PostureTask(cost=_POSTURE)
        self._posture.set_target(robot.n_pose)
        self._tasks: dict[str, Any] = {}
        self._configuration: Any = None
        self._targets: Mapping[str, LinkTarget] = {}
        self._stamp_ns = 0

    @property
    def scale(self) -> float:
        """Length of the robot's trajectories over the person's."""
        return self._person.scale

    def set_person(self, body: BodyModel) -> None:
        """Follow another person, or an improved body.

        Raises:
            BodyError: as of ``ScaledPerson``.
        """
        self._person = ScaledPerson(body, self._robot, REACH)

    def follow(self, stamp_ns: int, world_T_segment: Array) -> RobotState:
        """The robot when the person is at poses (S, 4, 4), later than at the call before."""
        targets = self._person.targets(world_T_segment)
        if self._configuration is None:
            self._initialise(targets)
            dt_s, rounds = np.inf, _FIRST_ROUNDS
        else:
            dt_s, rounds = 1e-9 * (stamp_ns - self._stamp_ns), _ROUNDS
        before = self._configuration.q.copy()
        self._bounds.set_previous(before, dt_s)
        blocked = False
        for number, share in enumerate(np.minimum(1.0, np.arange(1, rounds + 1) / (rounds - 1 or 1))):
            if number == 0 or dt_s > _SOON_S:
                self._watch_near_hulls()
            self._set_targets(targets, float(share))
            blocked |= not self._step()
        self._stamp_ns, self._targets = stamp_ns, targets
        return self._state(stamp_ns, before, dt_s, targets, blocked)

    def _initialise(self, targets: Mapping[str, LinkTarget]) -> None:
        """The robot in the N-pose, its root where it should be."""
        q = self._robot.n_pose.copy()
        placed = targets[self._robot.mapping.root].world_T_link @ self._robot.link_in_n_pose(self._robot.tree_root)
        q[:FLOATING] = self._pin.SE3ToXYZQUAT(self._pin.SE3(placed))
        model = self._robot.model
        self._configuration = self._pink.Configuration(model, model.createData(), q, collision_model=self._near)

    def _set_targets(self, targets: Mapping[str, LinkTarget], share: float) -> None:
        """Interpolate targets from the previous ones by a share: collisions are limited to first order only."""
        from pink.tasks import FrameTask

        for link, target in targets.items():
            if link not in self._tasks:
                place = _END_PLACE if target.is_end else _PLACE
                self._tasks[link] = FrameTask(
                    link,
                    position_cost=place if target.position_counts else 0.0,
                    orientation_cost=_TURN if target.rotation_counts else 0.0,
                    lm_damping=1e-3,
                )
            before = self._targets.get(link, target).world_T_link
            way = log_se3(inverse(before) @ target.world_T_link)
            self._tasks[link].set_target(self._pin.SE3(before @ exp_se3(share * way)))

    def _step(self) -> bool:
        """One round; False if no step satisfies all limits."""
        from pink.exceptions import NoSolutionFound

        tasks = [*self._tasks.values(), self._posture]
        for barriers in self._barriers:
            try:
                step = self._pink.solve_ik(
                    self._configuration, tasks, 1.0, _SOLVER, _DAMPING, limits=[self._bounds], barriers=barriers
                )
            except NoSolutionFound:
                continue
            return self._apply(step)
        return False

    def _apply(self, step: Array) -> bool:
        """Apply the largest share of a step without collisions, which are limited to first order; False without."""
        before, least_m = self._configuration.q.copy(), min(self._nearest_m(), _TOUCH_M)
        for share in _SHARES:
            self._configuration.update(self._pin.integrate(self._robot.model, before, share * step))
            if self._nearest_m() >= least_m:
                return True
        self._configuration.update(before)
        return False

    def _state(
        self, stamp_ns: int, before: Array, dt_s: float, targets: Mapping[str, LinkTarget], blocked: bool
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
            self._nearest_m(),
            blocked,
        )

    def _watch_near_hulls(self) -> None:
        """Keep the hulls apart that are near each other now: distances of all take most of a state's time."""
        from pink.barriers import SelfCollisionBarrier

        at, hulls = self._configuration, self._robot.hulls
        self._pin.computeDistances(at.model, at.data, hulls, self._all, at.q)
        self._near.removeAllCollisionPairs()
        for pair, found in zip(hulls.collisionPairs, self._all.distanceResults, strict=True):
            if found.min_distance < _NEAR_M:
                self._near.addCollisionPair(pair)
        at.collision_data = self._pin.GeometryData(self._near)
        at.update()
        # Hulls below the clearance move apart, or where no such step is feasible stay as near as they are.
        self._barriers = []
        for least_m in (-_BACK_M, 0.0):
            count = min(_MOST_NEAR, len(self._near.collisionPairs))
            barrier = SelfCollisionBarrier(count, safe_displacement_gain=0.0, d_min=_CLEARANCE_M)
            barrier.gain_function = partial(max, least_m)
            self._barriers.append([barrier] if count else [])

    def _nearest_m(self) -> float:
        """Distance of the nearest two hulls [m], negative where they touch; infinite if none are near."""
        found = self._configuration.collision_data.distanceResults
        return min((float(each.min_distance) for each in found), default=np.inf)

    def _pose_of(self, link: str) -> Array:
        pose: Array = self._configuration.get_transform_frame_to_world(link).homogeneous
        return pose
