import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.body.body_model import THICKEST, THINNEST, BodyModel, CameraMount, Mass, combined, sole_points
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


@pytest.mark.parametrize("girth", [0.1, 6.0])
def test_girths_beyond_people_are_refused_by_segment_and_number(girth: float) -> None:
    with naming(BodyError, "seat", f"{girth:g}", f"{THINNEST:g}", f"{THICKEST:g}"):
        stool(girths={"seat": girth})
    with naming(BodyError, "girths", "back"):
        stool(girths={"back": 1.0})


def test_joined_parts_have_the_mass_centre_and_inertia_of_all_their_points() -> None:
    random = np.random.default_rng(3)
    clouds = [random.normal(size=(50, 3)) + random.normal(size=3) for _ in range(3)]

    def mass_of(points: np.ndarray) -> Mass:
        """Points of 0.1 kg each."""
        lever = points - points.mean(axis=0)
        inertia = 0.1 * sum((x @ x * np.eye(3) - np.outer(x, x) for x in lever), np.zeros((3, 3)))
        return Mass(0.1 * len(points), points.mean(axis=0), inertia)

    joined, expected = combined([mass_of(cloud) for cloud in clouds]), mass_of(np.concatenate(clouds))
    assert joined.kilograms == pytest.approx(expected.kilograms)
    np.testing.assert_allclose(joined.centre, expected.centre, atol=1e-12)
    np.testing.assert_allclose(joined.inertia, expected.inertia, atol=1e-10)


def test_the_sole_is_below_the_ankle_its_heel_behind_and_its_ball_ahead() -> None:
    heel, ball = sole_points(0.43)
    assert heel[0] < 0.0 < ball[0] and heel[2] == ball[2] < 0.0
    np.testing.assert_allclose(sole_points(0.86), 2.0 * sole_points(0.43))
