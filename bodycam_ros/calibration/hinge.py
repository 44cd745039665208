"""Where a hinge's joint sits along its axis: the straight limb of the N-pose decides (A appendix, eq. 16-17).

A hinge leaves two null vectors in A eq. 14, so its joint may be anywhere on the axis, ``K(c) = K0 + c a`` (A eq. 16).
A leg that stands straight has hip, knee and ankle on one line (A eq. 17). An arm without a camera on the hand has no
third joint: hanging, its upper half is vertical. The first body is placed so, and the refined one again.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_edit import joint_named, move_joint
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import hat, rigid
from bodycam_ros.kinematics.joint import Joint

Array = NDArray[np.float64]

_UP = np.array([0.0, 0.0, 1.0])


def place_hinges(body: BodyModel, axes: Mapping[str, Array]) -> BodyModel:
    """Move the joints of hinges along their axes to where the N-pose's straight limbs want them (A eq. 16-17).

    Args:
        body: in N-pose axes.
        axes: child segment -> (3,) its hinge's axis, in N-pose axes.

    Raises:
        RangeOfMotionError: the straight limb does not decide.
    """
    # Hips before knees: a joint's own place decides where the line of the next one begins.
    for name in [joint.name for joint in body.tree_joints if joint.child in axes]:
        joint = joint_named(body, name)
        axis, (line_point, line_direction) = axes[joint.child], straight_line(body, joint)
        try:
            shift = shift_to_line(joint.parent_T_joint[:3, 3], axis, line_point, line_direction)
        except ValueError as error:
            raise RangeOfMotionError(f"joint {name}: {error}") from error
        place = joint.parent_T_joint[:3, 3] + shift * axis
        body = move_joint(body, name, rigid(joint.parent_T_joint[:3, :3], place))
    return body


def straight_line(body: BodyModel, joint: Joint) -> tuple[Array, Array]:
    """Point (3,) and direction (3,) of the line that a straight limb's middle joint is on, in its parent's frame.

    From the joint above to the one below (A eq. 17); where there is none below, straight down from the one above.
    """
    below = next((other.parent_T_joint[:3, 3] for other in body.tree_joints if other.parent == joint.child), None)
    if below is None:
        return np.zeros(3), _UP
    end = joint.parent_T_joint[:3, 3] + below
    return end, -end


def shift_to_line(on_axis: Array, axis: Array, line_point: Array, line_direction: Array) -> float:
    """The c that brings ``on_axis + c axis`` closest to a line: the least-squares solution of A eq. 17.

    Args:
        on_axis: (3,) a point on the hinge's axis [m], in the frame of the N-pose.
        axis: (3,) unit vector.
        line_point: (3,) a point that the line runs through, A's ankle or the joint above [m].
        line_direction: (3,) along the line, of any length.

    Raises:
        ValueError: the axis runs along the line, so no point of it is closest.
    """
    cross = hat(line_direction / np.linalg.norm(line_direction))
    across = cross @ axis
    squared = float(across @ across)
    if squared < 1e-6:
        raise ValueError("the hinge's axis runs along the straight limb, which does not fix its place")
    return float(-across @ (cross @ (on_axis - line_point)) / squared)
