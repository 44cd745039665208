import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import exp_se3, exp_so3, inverse
from bodycam_ros.kinematics.joint import Joint


def test_forward_kinematics_closes_every_joint_of_the_tree(body: BodyModel, random: np.random.Generator) -> None:
    world_T_root = exp_se3(random.normal(size=(7, 6)))
    rotations = exp_so3(random.normal(size=(7, len(body.tree_joints), 3)))
    for index, joint in enumerate(body.tree_joints):
        rotations[:, index] = joint.permitted_rotation(rotations[:, index])
    world_T_segment = body.forward_kinematics(world_T_root, rotations)
    np.testing.assert_array_equal(world_T_segment[:, body.segments.index("pelvis")], world_T_root)
    for index, joint in enumerate(body.tree_joints):
        world_T_parent = world_T_segment[:, body.segments.index(joint.parent)]
        world_T_child = world_T_segment[:, body.segments.index(joint.child)]
        between = inverse(world_T_parent @ joint.parent_T_joint) @ world_T_child @ joint.child_T_joint
        np.testing.assert_allclose(between[:, :3, 3], 0.0, atol=1e-12)
        np.testing.assert_allclose(between[:, :3, :3], rotations[:, index], atol=1e-12)
    np.testing.assert_allclose(body.joint_rotations(world_T_segment), rotations, atol=1e-12)


def stool(**changes: object) -> BodyModel:
    joint = Joint("post", "foot", "seat", "weld", np.eye(4))
    fields = {"name": "stool", "root": "foot", "segments": ("foot", "seat"), "joints": (joint,), "mounts": {}}
    return BodyModel(**(fields | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"segments": ("foot", "seat", "seat")}, ("seat",)),
        ({"joints": (Joint("post", "foot", "seat", "ball", np.eye(4)),) * 2}, ("post",)),
        ({"segments": ("foot", "seat", "back")}, ("back", "foot")),
        ({"mounts": {"cam": CameraMount("head", np.eye(4))}}, ("cam", "head")),
        ({"mounts": {"cam": CameraMount("seat", np.full((4, 4), np.nan))}}, ("cam",)),
    ],
)
def test_what_is_no_body_is_refused_by_name(changes: dict[str, object], named: tuple[str, ...]) -> None:
    with naming(BodyError, *named):
        stool(**changes)
