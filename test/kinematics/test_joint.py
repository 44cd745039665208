import numpy as np
import pytest
from helpers.naming import naming
from scipy.spatial.transform import Rotation

from bodycam_ros.errors import BodyError
from bodycam_ros.kinematics.joint import Joint, hinge_angle


def test_hinge_angle_is_the_twist_of_the_quaternion(random: np.random.Generator) -> None:
    rotations = Rotation.random(200, random_state=1)
    axes = random.normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    q = rotations.as_quat()
    twist = 2.0 * np.arctan2(np.sum(q[:, :3] * axes, axis=1), q[:, 3])
    difference = hinge_angle(rotations.as_matrix(), axes) - twist
    np.testing.assert_allclose(np.cos(difference), 1.0, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"type": "slider"}, ("slider", "ball, hinge, weld")),
        ({"child": "a"}, ()),
        ({"axis": np.zeros(3)}, ("axis",)),
        ({"parent_T_joint": np.full((4, 4), np.inf)}, ()),
        ({"sigmas": (1.0, 1.0, 1.0, 1.0, 1.0, 0.0)}, ()),
        ({"limits": ((0.0, 1.0),)}, ()),
    ],
)
def test_what_is_no_joint_is_refused_by_name(changes: dict[str, object], named: tuple[str, ...]) -> None:
    fields = {"name": "hip", "parent": "a", "child": "b", "type": "ball", "parent_T_joint": np.eye(4)} | changes
    with naming(BodyError, "joint hip", *named):
        Joint(**fields)  # type: ignore[arg-type]
