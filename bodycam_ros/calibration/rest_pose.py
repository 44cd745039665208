"""The zero pose of the body by the N-pose, and the heading of the person in it."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.articulation import ArticulatedMotion
from bodycam_ros.body.segment_name import LEFT, mirrored
from bodycam_ros.calibration.first_body import root_at_hips
from bodycam_ros.calibration.hinge import place_hinges
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import Array, exp_so3

_MAX_RISE = 0.3  # per length: a steeper line from right to left is no line of hips or shoulders of a standing person
_UP = np.array([0.0, 0.0, 1.0])


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
