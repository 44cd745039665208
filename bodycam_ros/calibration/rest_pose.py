"""The N-pose at the start of a recording: when it was held, its heading, and the zero pose of the body by it."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.articulation import ArticulatedMotion
from bodycam_ros.body.segment_name import LEFT, mirrored
from bodycam_ros.calibration.first_body import root_at_hips
from bodycam_ros.calibration.hinge import place_hinges
from bodycam_ros.calibration.virtual_camera import VirtualCamera
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import Array, exp_so3, inverse, log_so3, robust_average_pose

MAX_TURN_RAD = 0.06
"""People sway by a degree or two; a limb that sets out turns more."""

MAX_SHIFT_M = 0.04
"""People sway by a centimetre or two; registrations err by half of one."""

_MIN_DURATION_S = 0.5  # shorter stillness may be the turning point of a motion
_MAX_RISE = 0.3  # per length: a steeper line from right to left is no line of hips or shoulders of a standing person
_UP = np.array([0.0, 0.0, 1.0])


def find_rest_pose(seconds: Array, virtual: Mapping[str, VirtualCamera]) -> NDArray[np.intp]:
    """Rows (K) at the start in which the body stands still.

    Args:
        seconds: (T) [s].
        virtual: segment -> its cameras as one, at these times.

    Raises:
        RangeOfMotionError: the recording begins with motion, or a segment is unobserved while the body stands still.
    """
    end = len(seconds)
    ended_by = ""
    for segment, one in virtual.items():
        if (still := _still_until(seconds, one.world_T_virtual, one.known)) < end:
            end, ended_by = still, segment
    if end == 0 or seconds[end - 1] < _MIN_DURATION_S:
        moved = f"{ended_by} moves after {seconds[end] if end < len(seconds) else 0.0:.1f} s"
        raise RangeOfMotionError(
            f"the recording does not begin with the N-pose: {moved}; stand still, arms down, for 1.5 s, then begin "
            "the range of motion"
        )
    if end == len(seconds):
        raise RangeOfMotionError("nothing moves in this recording; a range of motion of every joint is needed")
    for segment, one in virtual.items():
        if not one.known[:end].any():
            raise RangeOfMotionError(
                f"segment {segment}: none of its cameras is registered while the body stands still in the N-pose "
                f"(the first {seconds[end - 1]:.1f} s), so its zero is not known; begin where the cameras see the map"
            )
    return np.arange(end)


def facing_direction(joints_world: Mapping[str, Array]) -> float:
    """Heading of a standing person [rad], about z from x: across the lines from right joints to their left ones.

    Args:
        joints_world: joint -> (3,) where it is in the N-pose.

    Raises:
        RangeOfMotionError: no joint has a partner on the other side.
    """
    leftward = np.zeros(3)
    for name, left in joints_world.items():
        right = joints_world.get(mirrored(name) or "")
        if name.endswith(LEFT) and right is not None:
            line = left - right
            # Longer lines give the direction better, and weigh more.
            if abs(line[2]) < _MAX_RISE * np.linalg.norm(line):
                leftward += line
    if np.linalg.norm(leftward[:2]) == 0:
        raise RangeOfMotionError(
            "no level line from a right to a left joint (hips, shoulders) shows which way the person faces in the "
            "N-pose; give it with --facing, in degrees about the map's z from its x"
        )
    forward = np.cross(leftward, _UP)
    return float(np.arctan2(forward[1], forward[0]))


@dataclass(frozen=True, eq=False)
class ZeroedMotion:
    """A motion whose zero is the N-pose.

    Attributes:
        motion: of the body.
        heading_rad: that the person faced in the N-pose [rad].
        hinges: child segment -> (3,) axis of its hinge, in N-pose axes.
    """

    motion: ArticulatedMotion
    heading_rad: float
    hinges: Mapping[str, Array]


def zero_at_rest(
    motion: ArticulatedMotion,
    resting: NDArray[np.bool_],
    facing_rad: float | None,
    hinges: Collection[str],
) -> ZeroedMotion:
    """Give a motion the frames of DESIGN 3: the N-pose is zero, the root is midway of the hips, hinges are in place.

    Args:
        motion: of the first body, or the refined one.
        resting: (T) rows in which the N-pose was held.
        facing_rad: heading of the person; None: by the refined joints.
        hinges: child segments of the joints that turned as hinges.
    """
    heading_rad = facing_rad
    if heading_rad is None:
        # Where on its axis a hinge sits is not known yet, and its axis runs from right to left.
        body = motion.with_zero_at(resting, np.eye(3)).body
        places = body.n_pose(np.eye(4))[body.joint_ends[:, 1], :3, 3]
        balls = [row for row, joint in enumerate(body.tree_joints) if joint.child not in hinges]
        heading_rad = facing_direction({body.tree_joints[row].name: places[row] for row in balls})
    motion = motion.with_zero_at(resting, exp_so3(heading_rad * _UP))
    axes = {child: motion.hinge_axis(child) for child in hinges}
    body = root_at_hips(place_hinges(motion.body, axes))  # A eq. 16-17
    return ZeroedMotion(motion.with_body(body), heading_rad, axes)


def _still_until(seconds: Array, poses: Array, known: NDArray[np.bool_]) -> int:
    """Number of rows from the start in which a segment is still; all of them if it never moves."""
    opening = np.flatnonzero(known & (seconds <= _MIN_DURATION_S))
    if len(opening) == 0:
        return len(seconds)
    start = robust_average_pose(poses[opening])
    moved = inverse(start) @ poses
    turns = np.linalg.norm(log_so3(moved[:, :3, :3]), axis=1)
    shifts = np.linalg.norm(poses[:, :3, 3] - start[:3, 3], axis=1)
    away = known & ((turns > MAX_TURN_RAD) | (shifts > MAX_SHIFT_M))
    # A single row is a wrong registration; motion lasts.
    lasting = np.flatnonzero(away[:-2] & (away[1:-1] | ~known[1:-1]) & (away[2:] | ~known[2:]))
    return int(lasting[0]) if len(lasting) else len(seconds)
