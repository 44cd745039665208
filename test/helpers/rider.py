"""A body with everything that a correction can meet."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.kinematics.joint import Joint


def pose(rotation_vector: list[float], position: list[float]) -> NDArray[np.float64]:
    return rigid(exp_so3(np.array(rotation_vector)), np.array(position))


def rider_body() -> BodyModel:
    """Joint frames turned and shifted on both sides, a sensor welded to the shin, and a foot on a pedal: a loop."""
    knee = Joint("knee", "thigh", "shin", "hinge", pose([0.1, -0.2, 0.3], [0.01, 0.0, -0.43]), axis=np.array([1, 4, 1]))
    welded = pose([0.2, 0.0, 0.4], [0.0, 0.02, 0.0])
    return BodyModel(
        name="rider",
        root="pelvis",
        segments=("shin", "pelvis", "foot", "thigh", "sensor", "crank"),
        joints=(
            knee,
            Joint("hip", "pelvis", "thigh", "ball", pose([0.3, 0.0, 0.1], [0.0, 0.095, 0.0])),
            Joint("ankle", "shin", "foot", "ball", pose([0.0, 0.3, 0.0], [0.0, 0.0, -0.42]), angle_axes="yxz"),
            Joint("strap", "shin", "sensor", "weld", pose([1.0, 0.5, 0.0], [0.0, 0.1, -0.2]), welded),
            Joint("axle", "pelvis", "crank", "hinge", pose([0.0, 0.0, 0.2], [0.1, 0.0, -0.7]), welded),
            Joint(
                "pedal", "crank", "foot", "ball", pose([0, 0, 0], [0.0, 0.1, -0.17]), pose([0, 0, 0], [0.1, 0, -0.1])
            ),
        ),
        mounts={
            "waist": CameraMount("pelvis", pose([-1.2, 1.1, -1.2], [0.14, 0.0, 0.04])),
            "thigh": CameraMount("thigh", pose([0.5, -1.0, 0.2], [0.02, 0.1, -0.2])),
            "shin": CameraMount("shin", pose([0.3, 1.0, 0.0], [0.09, 0.05, -0.1])),
            "foot": CameraMount("foot", pose([0.3, np.pi / 2, 0.0], [0.09, 0.05, 0.0])),
        },
        report={"hip": {"std_mm": 1.5}},
    )
