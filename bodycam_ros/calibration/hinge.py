"""Where a hinge's joint sits along its axis: the straight limb of the N-pose decides (A appendix, eq. 16-17).

A hinge leaves two null vectors in A eq. 14, so its joint may be anywhere on the axis, ``K(c) = K0 + c a`` (A eq. 16).
A leg that stands straight has hip, knee and ankle on one line (A eq. 17). An arm without a camera on the hand has no
third joint: hanging, its upper half is vertical.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import hat

Array = NDArray[np.float64]


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
        raise ValueError("the hinge's axis runs along the straight limb, so straightness does not tell where it sits")
    return float(-across @ (cross @ (on_axis - line_point)) / squared)
