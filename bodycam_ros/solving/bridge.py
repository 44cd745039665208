"""The body while all cameras were silent: when they should have spoken, and how it got from one side to the other.

A curve leaves with the body's velocity and arrives with it.

Cubic Hermite curves, of the root's pose and of every joint's rotation, so that no limb is stretched on the way. What
stands beside the body, on a free joint, goes its own way through the world as the root does; its cranks and wheels turn
on, over as many whole turns as their speed on both sides tells.
"""

from collections import deque
from collections.abc import Callable, Sequence
from statistics import median

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import exp_se3, exp_so3, inverse, log_se3, log_so3, rigid
from bodycam_ros.kinematics.euler_angles import nearest_turn
from bodycam_ros.kinematics.joint import hinge_angle
from bodycam_ros.solving.body_covariance import BodyUncertainty
from bodycam_ros.solving.body_frame import BodyFrame
from bodycam_ros.solving.body_state import BodyState

_SWING = 0.7
"""Share of the velocities that the curve keeps: at one, a joint that reverses on the way overshoots."""

_REMEMBERED = 15  # frames whose period is remembered: a single odd one does not count
_SILENT = 1.5  # periods: one missed image is at two

Array = NDArray[np.float64]


class Silence:
    """Knows the period of the cameras by their own stamps, so that cameras that run freely do not look faster.

    Args:
        max_pause_s: a longer silence is not filled.
    """

    def __init__(self, max_pause_s: float) -> None:
        self._max_pause_ns = 1e9 * max_pause_s
        self._periods_ns: deque[float] = deque(maxlen=_REMEMBERED)
        self._last_ns: int | None = None

    def missing(self, frame: BodyFrame) -> tuple[int, ...]:
        """Stamps [ns] between the instant before and this one at which a camera would have spoken."""
        last_ns, self._last_ns = self._last_ns, frame.stamp_ns
        own_ns = [m.stamp_ns - m.previous_stamp_ns for m in frame.matches.values() if m.previous_stamp_ns]
        period_ns = median(self._periods_ns) if self._periods_ns else None
        if own_ns:
            self._periods_ns.append(median(own_ns))
        pause_ns = frame.stamp_ns - last_ns if last_ns is not None else 0
        if period_ns is None or not _SILENT * period_ns < pause_ns <= self._max_pause_ns or last_ns is None:
            return ()
        steps = round(pause_ns / period_ns)
        return tuple(last_ns + round(pause_ns * step / steps) for step in range(1, steps))


def bridge(
    body: BodyModel, before: Sequence[BodyState], after: Sequence[BodyState], stamps_ns: Sequence[int], density: Array
) -> list[BodyState]:
    """The states at stamps (T) between two instants, which no camera saw.

    Args:
        body: its joints.
        before: the last one or two instants before, in order of time.
        after: the first one or two instants after, in order of time.
        stamps_ns: (T) in between.
        density: (6) spectral density of a segment's accelerations, rotation then translation.
    """
    start, end = before[-1], after[0]
    root = body.segment_index[body.root]
    leaving_s, arriving_s = _seconds(before), _seconds(after)
    whole_s = 1e-9 * (end.stamp_ns - start.stamp_ns)
    share = 1e-9 * (np.array(stamps_ns) - start.stamp_ns) / whole_s

    def swept(away: Callable[[Array], Array]) -> Array:
        """The curve (T, ...) of what ``away`` measures of poses (S, 4, 4) from where the body left."""
        arrived = away(end.world_T_segment)
        leaving = -away(before[0].world_T_segment) / leaving_s if leaving_s else np.zeros_like(arrived)
        passed_on = away(after[-1].world_T_segment) - arrived
        arriving = passed_on / arriving_s if arriving_s else np.zeros_like(arrived)
        return _curve(share, arrived, whole_s * leaving, whole_s * arriving)

    start_R = body.joint_rotations(start.world_T_segment)
    rotations = start_R @ exp_so3(
        swept(lambda poses: log_so3(np.swapaxes(start_R, -1, -2) @ body.joint_rotations(poses)))
    )
    known_R = np.array(
        [body.joint_rotations(posture.world_T_segment) for posture in (before[0], start, end, after[-1])]
    )
    for row, joint in enumerate(body.tree_joints):
        if joint.type == "hinge" and joint.limits is None and joint.child in body.equipment_segments:
            turned = _turning_on(share, hinge_angle(known_R[:, row], joint.axis), (leaving_s, whole_s, arriving_s))
            rotations[:, row] = joint.hinge_rotation(turned)

    def through_the_world(row: int) -> Array:
        world_T_start = start.world_T_segment[row]
        swept_through: Array = world_T_start @ exp_se3(
            swept(lambda poses: log_se3(inverse(world_T_start) @ poses[row]))
        )
        return swept_through

    known = [_between(start.uncertainty, end.uncertainty, float(u), whole_s, density) for u in share]
    motion, world_T_root = rigid(rotations, np.zeros(3)), through_the_world(root)
    poses = body.forward_kinematics(world_T_root, motion)
    for row, joint in enumerate(body.tree_joints):
        if joint.type == "free":
            world_T_joint = poses[:, body.segment_index[joint.parent]] @ joint.parent_T_joint
            world_T_child = through_the_world(body.segment_index[joint.child])
            motion[:, row] = inverse(world_T_joint) @ world_T_child @ joint.child_T_joint
            poses = body.forward_kinematics(world_T_root, motion)
    unseen = np.zeros(len(body.segments), bool)
    return [
        BodyState(stamp_ns, body.segments, world_T_segment, uncertainty, unseen, 0)
        for stamp_ns, world_T_segment, uncertainty in zip(stamps_ns, poses, known, strict=True)
    ]


def _turning_on(share: Array, angles: Array, seconds: tuple[float, float, float]) -> Array:
    """Angles (T) [rad] of what keeps its speed, at shares (T,) of the way.

    Args:
        share: of the way between the middle two of the angles.
        angles: (4) before, at the start, at the end and after [rad], whole turns unknown.
        seconds: (3) between them [s]; zero where nothing is known of the speed.
    """
    leaving_s, whole_s, arriving_s = seconds
    steps = nearest_turn(np.diff(angles), np.zeros(3))
    speeds = [step / second for step, second in ((steps[0], leaving_s), (steps[2], arriving_s)) if second]
    # Where one side's speed is unknown it is the other's.
    leaving, arriving = whole_s * np.array([speeds[0], speeds[-1]] if speeds else [0.0, 0.0])
    through = nearest_turn(steps[1], 0.5 * (leaving + arriving))
    turned: Array = angles[1] + _curve(share, through, leaving, arriving, swing=1.0)
    return turned


def _between(
    start: BodyUncertainty, end: BodyUncertainty, share: float, whole_s: float, density: Array
) -> BodyUncertainty:
    """Covariances on the way: a white-noise acceleration pinned at both ends leaves q (t (T - t))^3 / (3 T^3)."""
    pinned = (share * (1.0 - share)) ** 3 * whole_s**3 / 3.0 * density
    spun = whole_s * share * (1.0 - share) * density

    def mixed(a: Array, b: Array) -> Array:
        return (1.0 - share) * a + share * b

    return BodyUncertainty(
        root=mixed(start.root, end.root) + np.diag(pinned),
        root_twist=mixed(start.root_twist, end.root_twist) + np.diag(spun),
        # Both segments of a joint may have turned.
        joints=mixed(start.joints, end.joints) + 2.0 * np.diag(pinned[:3]),
        segments=mixed(start.segments, end.segments) + np.diag(pinned),
    )


def _seconds(states: Sequence[BodyState]) -> float:
    return 1e-9 * (states[-1].stamp_ns - states[0].stamp_ns)


def _curve(share: Array, end: Array, leaving: Array, arriving: Array, swing: float = _SWING) -> Array:
    """Cubic Hermite curve (T, ...) from zero to ``end`` (...) at shares (T,) of the way, with both ends' velocities."""
    u = share.reshape(-1, *[1] * end.ndim)
    curve: Array = u**2 * (3 - 2 * u) * end + swing * ((u**3 - 2 * u**2 + u) * leaving + (u**3 - u**2) * arriving)
    return curve
