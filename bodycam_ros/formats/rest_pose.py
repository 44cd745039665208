"""Poses in which the bones of other programs are not turned: arms down, out, or half-way."""

from collections.abc import Mapping

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anthropometry import LEFT, RIGHT
from bodycam_ros.geometry import Array, exp_so3, inverse, rigid

REST_POSES: Mapping[str, float] = {"N": 0.0, "T": np.pi / 2.0, "A": np.pi / 4.0}
"""Rest pose -> how far the arms are raised sideways from the N-pose [rad]."""

_ARM = "upper_arm"


def rest_pose(body: BodyModel, name: str) -> Array:
    """Poses root_T_segment (S, 4, 4) of a body in a rest pose, a key of ``REST_POSES`` [m].

    Arms are raised about the axis that points forward, palms then face down. A body without arms stands as in the
    N-pose.
    """
    poses = body.n_pose(np.eye(4))
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        row = body.segment_index.get(f"{_ARM}{side}")
        if row is None:
            continue
        shoulder = rigid(np.eye(3), poses[row, :3, 3])
        raised = rigid(exp_so3(np.array([sign * REST_POSES[name], 0.0, 0.0])), np.zeros(3))
        below = body.rows_below.get(row, [row])
        poses[below] = shoulder @ raised @ inverse(shoulder) @ poses[below]
    return poses
