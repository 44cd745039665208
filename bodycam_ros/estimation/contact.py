"""A foot that stands does not slide: while a point of its sole rests, it is where it was at the instant before.

A foot stands on its heel, on its ball or on both, so each of the two rests or does not by itself: where the solved
motion is slow there and near the floor. The factors tie the latest two solved instants, of which all cameras have
spoken by then, so that a foot is held by what was seen and let go by it.

The rotation of a foot that no camera sees is a guess; there the ankle tells (``resting_point.py``), and the sole says
how the foot turned, but nothing of how far the ankle is: a guess must not drag the leg.
"""

from collections.abc import Callable, Iterable

import gtsam
import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.sole import sole_points
from bodycam_ros.errors import BodyError
from bodycam_ros.estimation.body_window import BodyWindow, Instant
from bodycam_ros.estimation.contact_settings import ContactSettings
from bodycam_ros.estimation.resting_point import RestingPoint, Step
from bodycam_ros.geometry import Array, adjoint, inverse, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.shown import shown

_NO_OPINION_RAD, _NO_OPINION_M = 10.0, 0.1
_LEAST_SHIN_M = 0.05
"""Where a shin begins at its ankle nobody knows how large the foot is."""


class FootContacts:
    """Tells which points of the soles rest, and holds them.

    Args:
        body: whose feet stand.
        settings: when and how firmly.

    Raises:
        BodyError: a segment that should stand is none of the body's, or hangs on none.
    """

    def __init__(self, body: BodyModel, settings: ContactSettings | None = None) -> None:
        self._settings = settings or ContactSettings()
        feet = _feet(body, self._settings.segments.split()) if self._settings.enabled else []
        self._above = {body.segment_index[foot.child]: body.segment_index[foot.parent] for foot in feet}
        self._cameras = {body.segment_index[foot.child]: body.cameras_on(foot.child) for foot in feet}
        self._points = [
            RestingPoint(body.segment_index[foot.child], foot.child_T_joint[:3, 3], arm, self._settings)
            for foot in feet
            for arm in sole_points(float(np.linalg.norm(foot.parent_T_joint[:3, 3])))
        ]

    def factors(self, window: BodyWindow, key: Callable[[int, int], int]) -> gtsam.NonlinearFactorGraph:
        """What the soles say of the latest two instants of a window, which are solved.

        Args:
            window: with the instants before the one that the factors go along with.
            key: variable of an instant's index and a segment's row.
        """
        graph = gtsam.NonlinearFactorGraph()
        if len(window.instants) < 2 or not window.reaches(window.instants[-2].index):
            for point in self._points:
                point.let_go()
            return graph
        before, latest = window.instants[-2], window.instants[-1]
        passed_s = 1e-9 * (latest.stamp_ns - before.stamp_ns)
        poses, poses_before = window.poses(latest), window.poses(before)
        for point in self._resting(window, latest, poses):
            row = point.row
            keys = key(before.index, row), key(latest.index, row)
            creep = self._settings.creep if latest.observed[row] else self._settings.blind_creep
            graph.add(self._stays(point, keys, inverse(poses_before[row]) @ poses[row], passed_s * creep))
            if point.anchor is not None:
                graph.add(self._anchored(point, keys[1], point.anchor, poses[row]))
        return graph

    def _resting(self, window: BodyWindow, latest: Instant, poses: Array) -> list[RestingPoint]:
        """The points that rest at the latest instant."""
        since = self._since(window, latest)
        poses_since, took_s = window.poses(since), 1e-9 * (latest.stamp_ns - since.stamp_ns)
        for point in self._points:
            row = point.row
            # A camera that is not believed may be wrong, or see a foot that jumps: no time to hold on to it.
            refused = any(camera in latest.recorded.refused for camera in self._cameras[row])
            if not latest.observed[row] and (refused or not _turns_known(latest, self._above[row])):
                point.let_go()
                continue
            seen = _turns_known(latest, row)
            step = Step(poses[row], poses_since[row], took_s, latest.stamp_ns, seen)
            point.follow(step, self._floor)
        return [point for point in self._points if point.since_ns is not None]

    @property
    def _floor(self) -> float:
        """The lowest level [m] at which a point stood when it last stood firmly; z = 0 where all stood higher.

        Who stands on pedals or on stairs does not raise the floor: a foot there rests once it stands firmly.
        """
        return min((0.0, *(point.level for point in self._points if point.level is not None)))

    def _since(self, window: BodyWindow, latest: Instant) -> Instant:
        """The instant that speeds are taken from."""
        earlier = list(window.instants)[:-1]
        longest_ns = 1e9 * self._settings.speed_time
        return next((i for i in earlier if latest.stamp_ns - i.stamp_ns <= longest_ns), earlier[-1])

    def _stays(self, point: RestingPoint, keys: tuple[int, int], step: Array, sigma: float) -> gtsam.BetweenFactorPose3:
        """A ball joint at the point, between the foot at an instant and at the next, which turned by ``step``."""
        turn = step[:3, :3]
        measured = rigid(turn, point.place - turn @ point.place)
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = _NO_OPINION_RAD**2 * np.eye(3)
        covariance[3:, 3:] = sigma**2 * np.eye(3) if point.anchor is None else _across(point.arm, sigma)
        foot_xi_point = adjoint(rigid(np.eye(3), point.place))
        noise = gtsam.noiseModel.Gaussian.Covariance(foot_xi_point @ covariance @ foot_xi_point.T)
        return gtsam.BetweenFactorPose3(*keys, gtsam.Pose3(measured), noise)

    def _anchored(self, point: RestingPoint, key: int, anchor: Array, world_T_foot: Array) -> gtsam.GPSFactorArm:
        """Where in the world the point of a foot that is not seen rests."""
        covariance = _across(world_T_foot[:3, :3] @ point.arm, self._settings.blind_sigma)
        noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
        return gtsam.GPSFactorArm(key, anchor, point.place, noise)


def _across(arm: Array, sigma: float) -> Array:
    """Covariance (3, 3) of a place that is known across an arm (3,) to ``sigma`` [m], and not along it."""
    along = np.outer(arm, arm) / (arm @ arm)
    return np.asarray(sigma**2 * (np.eye(3) - along) + _NO_OPINION_M**2 * along)


def _turns_known(instant: Instant, row: int) -> bool:
    """Whether cameras say how a segment turned."""
    return bool(instant.observed[row]) or row in instant.recorded.turns


def _feet(body: BodyModel, names: Iterable[str]) -> list[Joint]:
    """The joints that the named segments hang on; the usual names may be missing.

    Raises:
        BodyError: another name is none that could stand.
    """
    usual = ContactSettings().segments.split()
    joints = []
    for name in names:
        joint = body.joint_to_parent(name)
        if joint is not None:
            if np.linalg.norm(joint.parent_T_joint[:3, 3]) > _LEAST_SHIN_M:
                joints.append(joint)
        elif name not in usual:
            raise BodyError(
                f"contact.segments: {shown(name)} cannot stand on body {body.name}; a segment that stands hangs on "
                f"another: {', '.join(joint.child for joint in body.tree_joints)}"
            )
    return joints
