"""Corrections are exact: one thing moves, and in the N-pose nothing else does."""

import numpy as np
import pytest
from helpers.naming import naming
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from bodycam_ros.body.body_edit import joint_named, move_joint, move_mount
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import exp_so3, rigid

EXACT = 1e-12
ROOT = rigid(exp_so3(np.array([0.2, -0.4, 1.0])), np.array([3.0, -2.0, 1.0]))
SHIFT = np.array([0.013, -0.021, 0.034])
TREE = ["hip", "knee", "ankle", "strap", "axle"]
TURN = exp_so3(np.array([0.1, 0.2, -0.15]))

Poses = dict[str, NDArray[np.float64]]


def cameras(body: BodyModel) -> Poses:
    """World poses of the cameras in the N-pose."""
    world_T_segment = body.n_pose(ROOT)
    return {
        name: world_T_segment[body.segment_index[mount.segment]] @ mount.segment_T_camera
        for name, mount in body.mounts.items()
    }


def joints(body: BodyModel, side: str = "parent") -> Poses:
    """World poses of the joints' frames in the N-pose, by the parent or by the child."""
    world_T_segment = body.n_pose(ROOT)
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
    parent = rider.n_pose(ROOT)[rider.segment_index[was.parent]]
    for side in ("parent", "child"):
        assert_allclose(joints(moved, side)[name], parent @ wanted, rtol=0.0, atol=EXACT)


def test_a_loop_joint_moves_no_segment_but_its_place_on_both(rider: BodyModel) -> None:
    step = rigid(TURN, SHIFT)
    moved = move_joint(rider, "pedal", joint_named(rider, "pedal").parent_T_joint @ step)
    assert_allclose(moved.n_pose(ROOT), rider.n_pose(ROOT), rtol=0.0, atol=EXACT)
    assert_same(cameras(moved), cameras(rider))
    for side in ("parent", "child"):
        assert_same(joints(moved, side), joints(rider, side), "pedal")
        assert_allclose(joints(moved, side)["pedal"], joints(rider, side)["pedal"] @ step, rtol=0.0, atol=EXACT)


def test_what_is_not_there_is_named(rider: BodyModel) -> None:
    with naming(BodyError, "elbow", "knee", "hip", "ankle"):
        move_joint(rider, "elbow", np.eye(4))
    with naming(BodyError, "hat", "waist", "thigh"):
        move_mount(rider, "hat", np.eye(4))
    with naming(BodyError, "knee"):
        move_joint(rider, "knee", np.full((4, 4), np.nan))
