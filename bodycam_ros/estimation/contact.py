"""Contact of the feet with the floor: a point of a sole that rests is where it was in the state before.

A foot rests on its heel, on its ball or on both, so each point rests or not by itself: where the solved motion is slow
there and near the floor.

The rotation of an unobserved foot is a prediction. There the ankle decides: a foot lands flat, and later the ankle
moves on a circle about the point. Such a sole constrains how the foot turns, and not how far the ankle is from it: a
predicted rotation must not drag the leg.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, sole_points
from bodycam_ros.errors import BodyError
from bodycam_ros.estimation.between_factors import RestingPoint
from bodycam_ros.geometry import Array, transform_points
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.settings import setting
from bodycam_ros.shown import shown

Mask = NDArray[np.bool_]

REST, LEAVE = 0.06, 0.12  # [m/s] a slower point of the sole comes to rest and may creep by as much; a faster one leaves
MAX_HEIGHT_M = 0.1  # of a point that just became slow, over the level that feet rested on last: pedals are higher
_BLIND_REST, _BLIND_LEAVE = 0.1, 0.15  # [m/s] the same of the ankle of an unobserved foot
_SPEED_S = 0.04  # speeds are over this time, or from one frame to the next
_FIRM_NS = 200_000_000  # a point that was slow for so long rests at any level; feet in the air are not
_BLIND_M = 0.02  # sigma of the resting point of an unobserved foot: shoes are not flat
_UNKNOWN_M = 0.1  # sigma along the arm, which its resting point does not constrain
_LEAST_SHIN_M = 0.05  # a foot whose parent starts at the ankle has no known size


@dataclass(frozen=True)
class ContactSettings:
    """Contact of feet with the floor."""

    enabled: bool = setting(True, reason="constrain resting feet; false leaves feet to the cameras alone")
    segments: str = setting("foot_left foot_right", reason="names of the feet, of which a body may lack some")


class FootContacts:
    """Finds the points of the soles that rest.

    Args:
        body: with feet.
        settings: which segments are feet.

    Raises:
        BodyError: a named segment is none of the body's, or is its root.
    """

    def __init__(self, body: BodyModel, settings: ContactSettings) -> None:
        row = body.segment_index
        feet = _feet(body, settings.segments.split()) if settings.enabled else []
        self.points = [
            _SolePoint(row[foot.child], row[foot.parent], foot.child_T_joint[:3, 3], arm)
            for foot in feet
            for arm in sole_points(float(np.linalg.norm(foot.parent_T_joint[:3, 3])))
        ]
        self.reset()

    def reset(self) -> None:
        """Forget the motion."""
        self._history: deque[tuple[int, Array]] = deque()
        for point in self.points:
            point.release()

    def resting_points(self, stamp_ns: int, poses: Array, observed: Mask, turning: Mask) -> list[RestingPoint]:
        """The constraints of points that rest.

        Args:
            stamp_ns: of the state [ns].
            poses: (S, 4, 4) solved without them.
            observed: (S,) observed segments.
            turning: (S,) segments whose rotation is measured at least.
        """
        while len(self._history) > 1 and stamp_ns - self._history[0][0] > 1e9 * _SPEED_S:
            self._history.popleft()
        if not self._history:
            return []
        since_ns, since = self._history[0]
        floor = min((0.0, *(point.level for point in self.points if point.level is not None)))
        passed_s = 1e-9 * (stamp_ns - self._history[-1][0])
        resting = []
        for point in self.points:
            row = point.row
            if not observed[row] and not turning[point.parent]:
                point.release()
                continue
            point.follow(stamp_ns, poses[row], since[row], 1e-9 * (stamp_ns - since_ns), bool(turning[row]), floor)
            if point.rests:
                resting += point.constraints(poses[row], REST * (1.0 if observed[row] else 2.0) * passed_s)
        return resting

    def remember(self, stamp_ns: int, poses: Array) -> None:
        """Add the final poses (S, 4, 4) of a state."""
        self._history.append((stamp_ns, poses))


@dataclass
class _SolePoint:
    """One point of a sole.

    Attributes:
        row, parent: of the foot and of its parent among the segments.
        ankle: (3,) the joint of the foot, in the foot [m].
        arm: (3,) from there to the point, in the foot [m].
        level: height at which it last rested firmly [m]. Pedals and stairs do not raise the floor: a foot there rests
            once it is firm.
        anchor: (3,) where the point of an unobserved foot came to rest, in the world [m].
        rests: whether it does.
        slow_since_ns: stamp from which on it has been slow.
    """

    row: int
    parent: int
    ankle: Array
    arm: Array
    level: float | None = None
    anchor: Array | None = field(default=None, init=False)
    rests: bool = field(default=False, init=False)
    slow_since_ns: int | None = field(default=None, init=False)

    def release(self) -> None:
        """It does not rest."""
        self.rests, self.anchor, self.slow_since_ns = False, None, None

    def follow(self, stamp_ns: int, now: Array, before: Array, took_s: float, turning: bool, floor: float) -> None:
        """Decide whether it rests: slow and near the floor, or slow for long enough to define a floor of its own.

        Args:
            stamp_ns: [ns].
            now, before: (4, 4) poses of its foot, ``took_s`` [s] after each other.
            took_s: [s].
            turning: whether the rotation of the foot is measured.
            floor: its level [m].
        """
        ends = np.stack([self.ankle + self.arm, self.ankle])
        (place, ankle), (place_before, ankle_before) = transform_points(now, ends), transform_points(before, ends)
        if turning:
            moved, limit = place - place_before, REST if self.slow_since_ns is None else LEAVE
        elif self.rests:
            # The heel may rise, which moves the ankle on a circle about the point.
            rise = np.cross(now[:3, 1], place - ankle)
            rise /= np.linalg.norm(rise)
            moved, limit = ankle - ankle_before, _BLIND_LEAVE
            moved = moved - (moved @ rise) * rise
        else:
            # The foot lands flat.
            place, moved, limit = np.array([*place[:2], ankle[2] + self.arm[2]]), ankle - ankle_before, _BLIND_REST
        if np.linalg.norm(moved) >= limit * took_s:
            self.release()
            return
        if self.slow_since_ns is None:
            self.slow_since_ns = stamp_ns
        is_firm = turning and stamp_ns - self.slow_since_ns >= _FIRM_NS
        if place[2] - floor >= MAX_HEIGHT_M and not is_firm:
            self.rests, self.anchor = False, None
            return
        self.rests = True
        if is_firm:
            self.level = float(place[2])
        if turning:
            self.anchor = None
        elif self.anchor is None:
            self.anchor = place

    def constraints(self, now: Array, creep: float) -> list[RestingPoint]:
        """At a pose (4, 4) of its foot: it moved by ``creep`` [m] at most; unobserved, it is where it came to rest."""
        place = self.ankle + self.arm
        if self.anchor is None:
            return [RestingPoint(self.row, place, np.eye(3) / creep, None)]
        arm = now[:3, :3] @ self.arm
        return [
            RestingPoint(self.row, place, _across(arm, creep), None),
            RestingPoint(self.row, place, _across(arm, _BLIND_M), self.anchor),
        ]


def _across(arm: Array, sigma: float) -> Array:
    """Whitening (3, 3) of a place that is known across an arm (3,) to ``sigma`` [m], and not along it."""
    along = np.outer(arm, arm) / (arm @ arm)
    return np.asarray((np.eye(3) - along) / sigma + along / _UNKNOWN_M)


def _feet(body: BodyModel, names: Iterable[str]) -> list[Joint]:
    """The joints of the named segments to their parents; the default names may be missing.

    Raises:
        BodyError: another name is no segment with a parent.
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
                f"contact.segments: {shown(name)} is no foot of body {body.name}; a foot is the child of a joint: "
                f"{', '.join(joint.child for joint in body.tree_joints)}"
            )
    return joints
