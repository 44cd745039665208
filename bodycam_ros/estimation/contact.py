"""A foot that stands does not slide: while a point of its sole rests, it is where it was at the instant before.

A foot stands on its heel, on its ball or on both, so each of the two rests or does not by itself: where the solved
motion is slow there and near the floor.

The rotation of a foot that no camera sees is a guess. There the ankle tells: at rest, the foot has landed flat; later
the ankle moves on a circle about the point. And the sole tells how the foot turned, but nothing of how far the ankle
is: a guess must not drag the leg.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, sole_points
from bodycam_ros.errors import BodyError
from bodycam_ros.estimation.motion_model import StandingPoint
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.settings import setting
from bodycam_ros.shown import shown

Mask = NDArray[np.bool_]

_NO_OPINION_M = 0.1
_LEAST_SHIN_M = 0.05
"""Where a shin begins at its ankle nobody knows how large the foot is."""

REST, LEAVE = 0.06, 0.12
"""[m/s] a slower point of the sole has come to rest, and creeps by as much; a faster one rests no longer."""

_BLIND_REST, _BLIND_LEAVE = 0.1, 0.15
"""[m/s] the same of the ankle of a foot that no camera sees, as it nears or leaves the point."""

_SPEED_S = 0.04
"""Speeds are taken over this time, or from one image to the next."""

_FIRM_NS = 200_000_000
"""A point that has been slow for so long stands, at whatever level; a foot that turns back in the air is not."""

MAX_HEIGHT_M = 0.1
"""Of a point that has just become slow, over the level that feet stood on last, at first z = 0: pedals are higher."""

_BLIND_M = 0.02
"""How well it is known where a point of a blind foot rests: shoes are not flat."""


@dataclass(frozen=True)
class ContactSettings:
    """Whether feet stand."""

    enabled: bool = setting(True, reason="a foot that stands does not slide; false leaves feet to the cameras alone")
    segments: str = setting(
        "foot_left foot_right", reason="names of the segments that stand, of which a body may lack some"
    )


class FootContacts:
    """Tells which points of the soles rest, and where they are held.

    Args:
        body: whose feet stand.
        settings: when and how firmly.

    Raises:
        BodyError: a segment that should stand is none of the body's, or hangs on none.
    """

    def __init__(self, body: BodyModel, settings: ContactSettings) -> None:
        feet = _feet(body, settings.segments.split()) if settings.enabled else []
        row = body.segment_index
        self.points = [
            _SolePoint(row[foot.child], row[foot.parent], foot.child_T_joint[:3, 3], arm)
            for foot in feet
            for arm in sole_points(float(np.linalg.norm(foot.parent_T_joint[:3, 3])))
        ]
        self.reset()

    def reset(self) -> None:
        """Nothing is known of the motion before."""
        self._lately: deque[tuple[int, Array]] = deque()
        for point in self.points:
            point.let_go()

    def resting_points(self, stamp_ns: int, poses: Array, observed: Mask, turning: Mask) -> list[StandingPoint]:
        """The points that rest.

        Args:
            stamp_ns: of the instant [ns].
            poses: (S, 4, 4) as it is solved without them.
            observed: (S,) segments that cameras see.
            turning: (S,) segments whose rotation is known at least.
        """
        while len(self._lately) > 1 and stamp_ns - self._lately[0][0] > 1e9 * _SPEED_S:
            self._lately.popleft()
        if not self._lately:
            return []
        since_ns, since = self._lately[0]
        floor = min((0.0, *(point.level for point in self.points if point.level is not None)))
        passed_s = 1e-9 * (stamp_ns - self._lately[-1][0])
        standing = []
        for point in self.points:
            row = point.row
            if not observed[row] and not turning[point.above]:
                point.let_go()
                continue
            point.follow(stamp_ns, poses[row], since[row], 1e-9 * (stamp_ns - since_ns), bool(turning[row]), floor)
            if point.rests:
                creep = REST * (1.0 if observed[row] else 2.0) * passed_s
                standing += point.held(poses[row], creep)
        return standing

    def remember(self, stamp_ns: int, poses: Array) -> None:
        """Where the body is at an instant."""
        self._lately.append((stamp_ns, poses))


class _SolePoint:
    """Follows one point.

    Args:
        row, above: of the foot and of what it hangs on among the segments.
        ankle: (3,) the joint that the foot hangs on, in the foot [m].
        arm: (3,) from there to the point, in the foot [m].

    Attributes:
        rests: whether it does.
        level: height at which it last stood firmly [m]; None before it has. Who stands on pedals or on stairs does
            not raise the floor: a foot there rests once it stands firmly.
    """

    def __init__(self, row: int, above: int, ankle: Array, arm: Array) -> None:
        self.row, self.above, self._ankle, self._arm, self._place = row, above, ankle, arm, ankle + arm
        self.level: float | None = None
        self.let_go()

    def let_go(self) -> None:
        """It does not rest."""
        self.rests = False
        self._anchor: Array | None = None  # where a foot that is not seen came to rest
        self._slow_since_ns: int | None = None

    def follow(self, stamp_ns: int, now: Array, before: Array, took_s: float, turning: bool, floor: float) -> None:
        """Decide whether it rests: slow and near the floor, or slow for long enough to be a floor of its own.

        Args:
            stamp_ns: [ns].
            now, before: (4, 4) poses of its foot, ``took_s`` [s] after each other.
            took_s: [s].
            turning: whether the rotation of the foot is known, and not a guess.
            floor: its level [m].
        """
        ends = np.stack([self._place, self._ankle])
        point, ankle = transform_points(now, ends)
        point_before, ankle_before = transform_points(before, ends)
        place, moved = point, ankle - ankle_before
        if turning:
            moved, limit = point - point_before, REST if self._slow_since_ns is None else LEAVE
        elif self.rests:
            # Its heel rises as it likes, which moves the ankle on a circle about the point.
            rise = np.cross(now[:3, 1], point - ankle)
            rise /= np.linalg.norm(rise)
            moved, limit = moved - (moved @ rise) * rise, _BLIND_LEAVE
        else:
            # Its rotation is a guess, but it lands flat.
            place, limit = np.array([*point[:2], ankle[2] + self._arm[2]]), _BLIND_REST
        if np.linalg.norm(moved) >= limit * took_s:
            self.let_go()
            return
        if self._slow_since_ns is None:
            self._slow_since_ns = stamp_ns
        is_firm = turning and stamp_ns - self._slow_since_ns >= _FIRM_NS
        if place[2] - floor >= MAX_HEIGHT_M and not is_firm:
            self.rests, self._anchor = False, None
            return
        self.rests = True
        if is_firm:
            self.level = float(point[2])
        if turning:
            self._anchor = None
        elif self._anchor is None:
            self._anchor = place

    def held(self, now: Array, creep: float) -> list[StandingPoint]:
        """What it tells of a foot at a pose (4, 4): it moved by ``creep`` [m] at most, and is where it came to rest."""
        if self._anchor is None:
            return [StandingPoint(self.row, self._place, np.eye(3) / creep, None)]
        arm = now[:3, :3] @ self._arm
        return [
            StandingPoint(self.row, self._place, _across(arm, creep), None),
            StandingPoint(self.row, self._place, _across(arm, _BLIND_M), self._anchor),
        ]


def _across(arm: Array, sigma: float) -> Array:
    """Whitening (3, 3) of a place that is known across an arm (3,) to ``sigma`` [m], and not along it."""
    along = np.outer(arm, arm) / (arm @ arm)
    return np.asarray((np.eye(3) - along) / sigma + along / _NO_OPINION_M)


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
