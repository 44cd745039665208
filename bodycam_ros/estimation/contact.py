"""Contact of the feet with the floor: a point of a sole at rest is where it was in the state before.

A foot rests on its heel, on its ball or on both, so each point is tested by itself: it rests where the solved motion is
slow, near the floor or for long. Feet whose rotation is not measured are left to the pose prior.
"""

from collections import deque
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
_SPEED_S = 0.04  # speeds are over this time, or from one frame to the next
_FIRM_NS = 200_000_000  # a point that was slow for so long rests at any level; feet in the air are not
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
        feet = _feet(body, settings.segments.split()) if settings.enabled else []
        self.points = [
            _SolePoint(body.segment_index[foot.child], foot.child_T_joint[:3, 3] + arm)
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
        since_ns, before = self._history[0]
        floor = min((0.0, *(point.level for point in self.points if point.level is not None)))
        creep_m = REST * 1e-9 * (stamp_ns - self._history[-1][0])
        resting = []
        for point in self.points:
            if not turning[point.row]:
                point.release()
                continue
            point.update(stamp_ns, poses[point.row], before[point.row], 1e-9 * (stamp_ns - since_ns), floor)
            if point.rests:
                resting.append(RestingPoint(point.row, point.place, creep_m if observed[point.row] else 2.0 * creep_m))
        return resting

    def remember(self, stamp_ns: int, poses: Array) -> None:
        """Add the final poses (S, 4, 4) of a state."""
        self._history.append((stamp_ns, poses))


@dataclass
class _SolePoint:
    """One point of a sole.

    Attributes:
        row: of the foot among the segments.
        place: (3,) of the point in the foot [m].
        level: height at which it last rested firmly [m]. Pedals and stairs do not raise the floor: a foot there rests
            once it is firm.
        rests: whether it does.
        slow_since_ns: stamp from which on it has been slow.
    """

    row: int
    place: Array
    level: float | None = None
    rests: bool = field(default=False, init=False)
    slow_since_ns: int | None = field(default=None, init=False)

    def release(self) -> None:
        """It does not rest."""
        self.rests, self.slow_since_ns = False, None

    def update(self, stamp_ns: int, now: Array, before: Array, passed_s: float, floor: float) -> None:
        """Decide whether it rests: slow and near the floor [m], or slow for long enough to define a floor of its own.

        ``now`` and ``before`` are poses (4, 4) of its foot, ``passed_s`` [s] apart.
        """
        end, start = transform_points(np.stack([now, before]), self.place[None])[:, 0]
        limit = REST if self.slow_since_ns is None else LEAVE
        if np.linalg.norm(end - start) >= limit * passed_s:
            self.release()
            return
        self.slow_since_ns = stamp_ns if self.slow_since_ns is None else self.slow_since_ns
        is_firm = stamp_ns - self.slow_since_ns >= _FIRM_NS
        self.rests = is_firm or bool(end[2] - floor < MAX_HEIGHT_M)
        if is_firm:
            self.level = float(end[2])


def _feet(body: BodyModel, names: list[str]) -> list[Joint]:
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
