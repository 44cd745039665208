"""The frames of DESIGN 3 on a refined motion: the N-pose is zero, x forward; hinges sit on their straight limbs."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.calibration.articulation import ArticulatedMotion
from bodycam_ros.calibration.first_body import place_hinges, root_at_hips
from bodycam_ros.calibration.rest_pose import facing_direction, heading_rotation

Array = NDArray[np.float64]


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
    heading_rad: float,
    heading_is_given: bool,
    hinges: Collection[str],
) -> ZeroedMotion:
    """Give the segments the axes of the N-pose, the root its origin midway of the hips, and hinges their place.

    Args:
        motion: refined.
        resting: (T) instants in which the N-pose was held.
        heading_rad: that the person faced, as far as known before.
        heading_is_given: by the user; else it is read off the refined joints.
        hinges: child segments of the joints that turned as hinges.
    """
    motion = motion.with_zero_at(resting, heading_rotation(heading_rad))
    if not heading_is_given:
        balls = [joint for joint in motion.body.tree_joints if joint.child not in hinges]
        correction_rad = facing_direction(motion.joints_at_zero(balls))
        heading_rad = float(np.angle(np.exp(1j * (heading_rad + correction_rad))))  # within half a turn
        motion = motion.with_segment_axes(np.stack([heading_rotation(correction_rad)] * len(motion.body.segments)))
    axes = {child: motion.hinge_axis(child) for child in hinges}
    body = root_at_hips(place_hinges(motion.body_with_geometry(), axes))  # A eq. 16-17
    return ZeroedMotion(motion.with_body(body), heading_rad, axes)
