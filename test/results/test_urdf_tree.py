"""Our forward kinematics of a URDF against yourdfpy, and documents that are none."""

import io

import numpy as np
import pytest
import yourdfpy
from known_walk import PARENTS, Walk, walking_body

from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.results.urdf_tree import UrdfTree

TURNED = """<robot name="turned"><link name="base"/><link name="arm"/><link name="tool"/>
<joint name="elbow" type="continuous"><origin xyz="0.1 -0.2 0.3" rpy="0.4 -0.5 2.6"/><axis xyz="1 2 -2"/>
<parent link="base"/><child link="arm"/></joint>
<joint name="flange" type="fixed"><parent link="arm"/><child link="tool"/><origin rpy="0 1.5707963 0"/></joint>
</robot>"""
"""An axis that is no unit vector, all three angles of an origin, and an origin without a position."""


@pytest.mark.parametrize("source", ["walk", "ride", "turned"])
def test_yourdfpy_agrees(walk: Walk, ride: Walk, source: str) -> None:
    text = {"walk": urdf_text(walk.body), "ride": urdf_text(ride.body), "turned": TURNED}[source]
    tree = UrdfTree.parse(text, "test")
    model = yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False, build_scene_graph=True)
    assert set(tree.moving) == set(model.actuated_joint_names)
    angles = np.random.default_rng(4).uniform(-6.0, 6.0, size=(5, len(tree.moving)))
    world_T_root = rigid(exp_so3(np.array([0.3, -0.8, 1.2])), np.array([4.0, 5.0, 6.0]))
    poses = tree.forward_kinematics(np.tile(world_T_root, (5, 1, 1)), dict(zip(tree.moving, angles.T, strict=True)))
    assert poses.keys() == set(model.link_map)
    for instant in range(5):
        model.update_cfg(dict(zip(tree.moving, angles[instant], strict=True)))
        for link, world_T_link in poses.items():
            np.testing.assert_allclose(world_T_link[instant], world_T_root @ model.get_transform(link), atol=1e-9)


def test_segments_are_told_from_cameras_and_from_the_inside_of_joints(walk: Walk) -> None:
    tree = UrdfTree.parse(urdf_text(walk.body), "test")
    assert tree.segments == walk.body.segments
    assert tree.cameras == ("waist", "shin")
    assert tree.parent_segments() == PARENTS


def test_equipment_hangs_on_the_body_that_it_stands_beside(ride: Walk) -> None:
    tree = UrdfTree.parse(urdf_text(ride.body), "test")
    assert tree.segments == ride.body.segments
    assert tree.parent_segments() == {**PARENTS, "frame": "pelvis", "crank": "frame"}
    assert tree.body_segments == walking_body().segments
    place = tuple(f"bicycle_at_{axis}" for axis in "xyz")
    assert tree.moving_beside == (*place, "bicycle_y", "bicycle_z", "bicycle_x", "crank")
    assert list(tree.equipment) == ["frame", "crank"] and tree.equipment["frame"] == ()
    np.testing.assert_allclose(tree.equipment["crank"], [[0.17, 0.1, 0.0]], atol=1e-9)


def test_a_joint_that_slides_alone_is_no_equipment() -> None:
    tree = UrdfTree.parse(TURNED.replace("continuous", "prismatic"), "test")
    assert tree.segments == ("base", "arm", "tool") and tree.body_segments == tree.segments
    assert not tree.moving_beside


def test_loops_that_are_none_are_refused_by_name(ride: Walk) -> None:
    with pytest.raises(RecordingError, match="out: not a URDF that can be read: joint knee_left"):
        UrdfTree.parse(urdf_text(ride.body).replace("type: hinge", "type: glue"), "out")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "not a URDF"),
        ("<robot><link name='a'/><link name='b'/></robot>", "has a, b"),
        (TURNED.replace("continuous", "planar"), "joint elbow is planar"),
        (TURNED.replace('xyz="1 2 -2"', 'xyz="1 2"'), '"1 2" is not three numbers'),
        (TURNED.replace('<parent link="base"/>', ""), "elbow lacks its parent"),
        (TURNED.replace('<parent link="base"/>', '<parent link="tool"/>'), "not hang on root"),
    ],
)
def test_what_is_no_body_is_refused_by_name(text: str, complaint: str) -> None:
    with pytest.raises(RecordingError, match="^out: .*") as caught:
        UrdfTree.parse(text, "out")
    assert complaint in str(caught.value)
