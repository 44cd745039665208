"""A small body with everything that a body may have."""

import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.joint import Joint
from bodycam_ros.geometry import exp_so3, rigid


def pose(rotation_vector: list[float], position: list[float]) -> NDArray[np.float64]:
    return rigid(exp_so3(np.array(rotation_vector)), np.array(position))


@pytest.fixture
def body() -> BodyModel:
    """Ball, hinge, weld, turned and shifted joint frames on both sides, a foot on a pedal: a loop; and a cart."""
    return BodyModel(
        name="rider",
        root="pelvis",
        # The root is not first, and parents come after their children.
        segments=("shin", "pelvis", "foot", "thigh", "sensor", "crank", "wheel", "cart"),
        joints=(
            Joint(
                "knee",
                "thigh",
                "shin",
                "hinge",
                pose([0.1, -0.2, 0.3], [0.01, 0.0, -0.43]),
                axis=np.array([1.0, 4.0, 1.0]),
            ),
            Joint("hip", "pelvis", "thigh", "ball", pose([0.0, 0.0, 0.0], [0.0, 0.095, 0.0])),
            Joint("ankle", "shin", "foot", "ball", pose([0.0, 0.3, 0.0], [0.0, 0.0, -0.42]), angle_axes="yxz"),
            Joint(
                "strap",
                "shin",
                "sensor",
                "weld",
                pose([1.0, 0.5, 0.0], [0.0, 0.1, -0.2]),
                pose([0.2, 0.0, 0.4], [0.0, 0.02, 0.0]),
            ),
            Joint(
                "axle",
                "pelvis",
                "crank",
                "hinge",
                pose([0.0, 0.0, 0.0], [0.1, 0.0, -0.7]),
                pose([0.0, 0.1, 0.0], [0.0, 0.0, 0.17]),
            ),
            Joint(
                "cart",
                "pelvis",
                "cart",
                "free",
                pose([0.2, 0.0, -0.1], [0.0, 0.0, 0.05]),
                pose([0.0, 0.4, 0.0], [0.3, 0.0, 0.1]),
                angle_axes="zxy",
            ),
            Joint("wheel_axle", "cart", "wheel", "hinge", pose([0.0, 0.0, 0.1], [0.0, 0.3, 0.2])),
            Joint(
                "pedal",
                "crank",
                "foot",
                "ball",
                pose([0.0, 0.0, 0.0], [0.0, 0.1, -0.17]),
                pose([0.0, 0.0, 0.0], [0.12, 0.0, -0.08]),
            ),
        ),
        mounts={
            "waist": CameraMount("pelvis", pose([-1.2, 1.1, -1.2], [0.14, 0.0, 0.04])),
            "handle": CameraMount("cart", pose([0.1, -1.0, 0.0], [0.0, 0.0, 0.9])),
            "foot": CameraMount("foot", pose([0.3, np.pi / 2, 0.0], [0.09, 0.05, 0.0])),
        },
        report={"hip": {"std_mm": 1.5}},
    )


@pytest.fixture
def random() -> np.random.Generator:
    return np.random.default_rng(5)
