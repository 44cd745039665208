"""Whether each joint was moved enough to be found, and which turned as hinges."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.calibration.anatomy import SegmentName
from bodycam_ros.calibration.joint_centre import JointCentre, JointCentreSettings
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RangeOfMotionError

Array = NDArray[np.float64]

_BALL, _HINGE = 3, 2


def check_exercised(rig: Rig, centres: Mapping[str, JointCentre], settings: JointCentreSettings) -> dict[str, Array]:
    """Hinges among the joints: child segment -> (3,) axis in the frame of the child's virtual camera.

    Args:
        rig: names.
        centres: child segment -> its joint.
        settings: thresholds.

    Raises:
        RangeOfMotionError: joints that were held still, or turned about one axis only where nothing else tells where
            on it they sit; each is named, with what to repeat.
    """
    hinges = {}
    complaints = []
    for child, centre in centres.items():
        named = SegmentName(child)
        freedoms = centre.freedoms(settings)
        values = ", ".join(f"{value:.3f}" for value in centre.singular_values)
        if freedoms < _HINGE:
            complaints.append(
                f"joint {named.joint} was held still (singular values {values}; each must exceed "
                f"{settings.free_rotation:g}): {named.exercise}"
            )
        elif freedoms < _BALL and not named.straight_in_rest:
            complaints.append(
                f"joint {named.joint} was turned about one axis only (singular values {values}; each must exceed "
                f"{settings.free_rotation:g}), so its place along that axis is open: {named.exercise}"
            )
        elif freedoms < _BALL:
            hinges[child] = centre.child_directions[2]
    if complaints:
        raise RangeOfMotionError(
            "the range of motion does not tell where every joint is. Repeat it, and\n  " + "\n  ".join(complaints)
        )
    return hinges
