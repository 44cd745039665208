"""A small body with everything that a body may have."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.kinematics.joint import Joint


def pose(rx: float, ry: float, rz: float, x: float, y: float, z: float) -> NDArray[np.float64]:
    """(4, 4) of a rotation vector [rad] and a position [m]."""
    return rigid(exp_so3(np.array([rx, ry, rz])), np.array([x, y, z]))


@pytest.fixture
def body() -> BodyModel:
    """Ball, hinge, weld, free, joint frames turned on both sides, a loop; parents after children, root not first."""
    wheel, rolled = pose(0, 0, 0.1, 0, 0.3, 0.2), pose(0, 0.4, 0, 0.3, 0, 0.1)
    strap, sensor = pose(1.0, 0.5, 0, 0, 0.1, -0.2), pose(0.2, 0, 0.4, 0, 0.02, 0)
    axle, crank = pose(0, 0, 0, 0.1, 0, -0.7), pose(0, 0.1, 0, 0, 0, 0.17)
    pedal, sole = pose(0, 0, 0, 0, 0.1, -0.17), pose(0, 0, 0, 0.12, 0, -0.08)
    knee, axis = pose(0.1, -0.2, 0.3, 0.01, 0, -0.43), np.array([1.0, 4.0, 1.0])
    return BodyModel(
        name="rider",
        root="pelvis",
        segments=("shin", "pelvis", "foot", "thigh", "sensor", "crank", "wheel", "cart"),
        joints=(
            Joint("knee", "thigh", "shin", "hinge", knee, axis=axis),
            Joint("hip", "pelvis", "thigh", "ball", pose(0, 0, 0, 0, 0.095, 0)),
            Joint("ankle", "shin", "foot", "ball", pose(0, 0.3, 0, 0, 0, -0.42), angle_axes="yxz"),
            Joint("strap", "shin", "sensor", "weld", strap, sensor),
            Joint("axle", "pelvis", "crank", "hinge", axle, crank),
            Joint("cart", "pelvis", "cart", "free", pose(0.2, 0, -0.1, 0, 0, 0.05), rolled, angle_axes="zxy"),
            Joint("wheel_axle", "cart", "wheel", "hinge", wheel),
            Joint("pedal", "crank", "foot", "ball", pedal, sole),
        ),
        mounts={
            "waist": CameraMount("pelvis", pose(-1.2, 1.1, -1.2, 0.14, 0, 0.04)),
            "handle": CameraMount("cart", pose(0.1, -1.0, 0, 0, 0, 0.9)),
            "foot": CameraMount("foot", pose(0.3, np.pi / 2, 0, 0.09, 0.05, 0)),
        },
        report={"hip": {"std_mm": 1.5}},
    )


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(5)
