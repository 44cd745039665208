"""Corrections are exact: one thing moves, and in the N-pose nothing else does."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from bodycam_ros.body.body_edit import joint_named, move_joint, move_mount, n_pose
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import exp_so3, inverse, rigid

EXACT = 1e-12
ROOT = rigid(exp_so3(np.array([0.2, -0.4, 1.0])), np.array([3.0, -2.0, 1.0]))
SHIFT = np.array([0.013, -0.021, 0.034])
TREE = ["hip", "knee", "ankle", "strap", "axle"]
TURN = exp_so3(np.array([0.1, 0.2, -0.15]))

Poses = dict[str, NDArray[np.float64]]


def cameras(body: BodyModel) -> Poses:
    """World poses of the cameras in the N-pose."""
    world_T_segment = n_pose(body, ROOT)
    return {
        name: world_T_segment[body.segment_index[mount.segment]] @ mount.segment_T_camera
        for name, mount in body.mounts.items()
    }


def joints(body: BodyModel, side: str = "parent") -> Poses:
    """World poses of the joints' frames in the N-pose, by the parent or by the child."""
    world_T_segment = n_pose(body, ROOT)
    return {
        joint.name: world_T_segment[body.segment_index[getattr(joint, side)]] @ getattr(joint, f"{side}_T_joint")
        for joint in body.joints
    }


def assert_same(now: Poses, before: Poses, *but: str) -> None:
    assert now.keys() == before.keys()
    for name in now.keys() - set(but):
        assert_allclose(now[name], before[name], rtol=0.0, atol=EXACT, err_msg=name)


@pytest.mark.parametrize("name", TREE)
def test_a_joint_moves_alone(rider: BodyModel, name: str) -> None:
    was = joint_named(rider, name)
    wanted = rigid(was.parent_T_joint[:3, :3], was.parent_T_joint[:3, 3] + SHIFT)
    moved = move_joint(rider, name, wanted)
    assert_same(cameras(moved), cameras(rider))
    for side in ("parent", "child"):
        assert_same(joints(moved, side), joints(rider, side), name)
    parent = n_pose(rider, ROOT)[rider.segment_index[was.parent]]
    for side in ("parent", "child"):
        assert_allclose(joints(moved, side)[name], parent @ wanted, rtol=0.0, atol=EXACT)


@pytest.mark.parametrize("name", TREE)
def test_a_joint_of_the_tree_takes_the_origin_of_its_child_along(rider: BodyModel, name: str) -> None:
    was = joint_named(rider, name)
    moved = move_joint(rider, name, rigid(was.parent_T_joint[:3, :3], was.parent_T_joint[:3, 3] + SHIFT))
    before, now = n_pose(rider, ROOT), n_pose(moved, ROOT)
    for row, segment in enumerate(rider.segments):
        step = before[rider.segment_index[was.parent]][:3, :3] @ SHIFT if segment == was.child else 0.0
        assert_allclose(now[row, :3, 3], before[row, :3, 3] + step, rtol=0.0, atol=EXACT, err_msg=segment)
        assert_allclose(now[row, :3, :3], before[row, :3, :3], rtol=0.0, atol=EXACT, err_msg=segment)
    assert_allclose(joint_named(moved, name).child_T_joint[:3, 3], was.child_T_joint[:3, 3], rtol=0.0, atol=EXACT)


def test_a_loop_joint_moves_no_segment_but_its_place_on_both(rider: BodyModel) -> None:
    step = rigid(TURN, SHIFT)
    moved = move_joint(rider, "pedal", joint_named(rider, "pedal").parent_T_joint @ step)
    assert_allclose(n_pose(moved, ROOT), n_pose(rider, ROOT), rtol=0.0, atol=EXACT)
    assert_same(cameras(moved), cameras(rider))
    for side in ("parent", "child"):
        assert_same(joints(moved, side), joints(rider, side), "pedal")
        assert_allclose(joints(moved, side)["pedal"], joints(rider, side)["pedal"] @ step, rtol=0.0, atol=EXACT)


def test_a_turned_hinge_keeps_the_zero_pose_and_bends_about_its_new_axis(rider: BodyModel) -> None:
    was = joint_named(rider, "knee")
    moved = move_joint(rider, "knee", was.parent_T_joint @ rigid(TURN, SHIFT))
    assert_same(cameras(moved), cameras(rider))
    rotations = np.tile(np.eye(3), (len(moved.tree_joints), 1, 1))
    row = [joint.name for joint in moved.tree_joints].index("knee")
    knee = moved.tree_joints[row]
    rotations[row] = knee.hinge_rotation(np.array(0.7))
    zero, bent = n_pose(moved, ROOT), moved.forward_kinematics(ROOT, rotations)
    shin, thigh = moved.segment_index["shin"], moved.segment_index["thigh"]
    world_axis = zero[thigh][:3, :3] @ was.parent_T_joint[:3, :3] @ TURN @ was.axis
    assert_allclose(bent[shin][:3, :3], exp_so3(0.7 * world_axis) @ zero[shin][:3, :3], rtol=0.0, atol=1e-12)
    centre = zero[thigh] @ knee.parent_T_joint[:, 3]
    in_shin = inverse(zero[shin]) @ centre
    assert_allclose(bent[shin] @ in_shin, centre, rtol=0.0, atol=EXACT)


def test_what_is_not_there_is_named(rider: BodyModel) -> None:
    with pytest.raises(BodyError, match="no joint elbow.*knee, hip, ankle"):
        move_joint(rider, "elbow", np.eye(4))
    with pytest.raises(BodyError, match="no camera hat.*waist, thigh"):
        move_mount(rider, "hat", np.eye(4))
    with pytest.raises(BodyError, match="not finite"):
        move_joint(rider, "knee", np.full((4, 4), np.nan))
