"""The lines that a body is drawn with: from joint to joint, to tips, and along equipment."""

import numpy as np
import pytest
from helpers.known_ride import make_ride

from bodycam_ros.body.average_person import body_of_height
from bodycam_ros.body.body_model import BodyModel, CameraMount, bone_ends
from bodycam_ros.body.stick_figure import Bone, body_bones, limb_bones
from bodycam_ros.geometry import exp_se3, rigid
from bodycam_ros.kinematics.joint import Joint


def moved(body: BodyModel, states: int = 3) -> np.ndarray:
    """Poses (S, T, 4, 4) of a body that is somewhere else at each state."""
    roots = exp_se3(np.random.default_rng(2).normal(size=(states, 6)))
    return np.stack([body.n_pose(root) for root in roots], axis=1)


def test_a_line_runs_from_each_segment_to_each_of_its_children() -> None:
    body = body_of_height(1.8, "person")
    poses = moved(body)
    lines = {(bone.segment, tuple(bone.end[0])): bone for bone in body_bones(body, poses)}
    for joint in body.tree_joints:
        parent, child = body.segment_index[joint.parent], body.segment_index[joint.child]
        bone = lines[joint.parent, tuple(poses[child, 0, :3, 3])]
        np.testing.assert_array_equal(bone.start, poses[parent, :, :3, 3])
        np.testing.assert_array_equal(bone.end, poses[child, :, :3, 3])
        assert not bone.is_equipment
    assert len(lines) == len(body.tree_joints) + 5, "and one to each tip: head, hands, feet"


def test_lengths_of_lines_stay_while_the_body_moves() -> None:
    for bone in body_bones(body := body_of_height(1.8, "person"), moved(body)):
        lengths = np.linalg.norm(bone.end - bone.start, axis=1)
        np.testing.assert_allclose(lengths, lengths[0], atol=1e-12)
        assert lengths[0] > 0.0


def test_one_state_is_that_of_many() -> None:
    body = body_of_height(1.8, "person")
    poses = moved(body)
    for one, many in zip(body_bones(body, poses[:, 1]), body_bones(body, poses), strict=True):
        at = many.at(1)
        assert one.segment == at.segment
        np.testing.assert_array_equal(one.start, at.start)
        np.testing.assert_array_equal(one.end, at.end)


def test_a_last_segment_without_a_known_tip_reaches_to_its_cameras() -> None:
    knee = Joint("knee", "thigh", "shin", "ball", rigid(np.eye(3), np.array([0.0, 0.0, -0.4])))
    mounts = {"cam": CameraMount("shin", rigid(np.eye(3), np.array([0.05, 0.0, -0.3])))}
    legs = BodyModel("legs", "thigh", ("thigh", "shin"), (knee,), mounts)
    (_, shin) = body_bones(legs, legs.n_pose(np.eye(4)))
    np.testing.assert_allclose(shin.end - shin.start, [[0.0, 0.0, -0.3]])
    (end,) = bone_ends(legs, "shin")
    np.testing.assert_allclose(end, [0.0, 0.0, -0.3])


def test_equipment_is_drawn_to_where_it_is_held() -> None:
    ride = make_ride()
    bones = body_bones(ride.body, np.moveaxis(ride.world_T_segment, 1, 0))
    equipment = [bone for bone in bones if bone.is_equipment]
    assert {bone.segment for bone in equipment} <= ride.body.equipment_segments
    assert {bone.segment for bone in bones if not bone.is_equipment} <= set(ride.body.segments) - set(
        ride.body.equipment_segments
    )
    held = [joint for joint in ride.body.loop_joints if joint.parent in ride.body.equipment_segments]
    assert held
    for joint in held:
        if np.linalg.norm(joint.parent_T_joint[:3, 3]) < 0.03:
            continue
        row = ride.body.segment_index[joint.parent]
        place = (ride.world_T_segment[:, row] @ joint.parent_T_joint)[:, :3, 3]
        assert any(np.allclose(bone.end, place) for bone in equipment if bone.segment == joint.parent), joint.name


@pytest.mark.parametrize("side", ["left", "right"])
def test_segments_that_are_not_there_have_no_line(side: str) -> None:
    body = body_of_height(1.8, "person")
    poses = dict(zip(body.segments, moved(body), strict=True))
    gone = poses.pop(f"shin_{side}")
    bones = limb_bones(poses, {joint.child: joint.parent for joint in body.tree_joints})
    assert all(isinstance(bone, Bone) and bone.segment != f"shin_{side}" for bone in bones)
    assert not any(np.array_equal(bone.end, gone[:, :3, 3]) for bone in bones)
