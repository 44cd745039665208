"""Poses of a body that limbs are raised to."""

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import LEFT, RIGHT
from bodycam_ros.geometry import Array, exp_so3, inverse, rigid


def raised(body: BodyModel, poses: Array, kind: str, angle: float) -> Array:
    """Poses root_T_segment (S, 4, 4) with both limbs of a kind raised sideways, about the axis that points forward.

    Args:
        body: of which a limb may be missing.
        poses: (S, 4, 4) upright.
        kind: of the segment that is raised, with what hangs on it: "upper_arm".
        angle: away from the body [rad].
    """
    turned: Array = poses.copy()
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        row = body.segment_index.get(f"{kind}{side}")
        if row is None:
            continue
        joint = rigid(np.eye(3), poses[row, :3, 3])
        turn = rigid(exp_so3(np.array([sign * angle, 0.0, 0.0])), np.zeros(3))
        below = body.rows_below.get(row, [row])
        turned[below] = joint @ turn @ inverse(joint) @ poses[below]
    return turned
