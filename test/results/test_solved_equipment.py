"""What is published of a body with equipment: links that joint states move are where the solver had them."""

import io
from pathlib import Path

import numpy as np
import pinocchio
import pytest
import yourdfpy
from helpers.known_ride import TURNS
from helpers.known_walk import Walk, write_solved

from bodycam_ros.geometry import inverse
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved
from bodycam_ros.results.topics import published_robot

EXACT = 1e-8  # files have nanometres


@pytest.fixture(scope="module")
def bag(ride: Walk, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_solved(ride, tmp_path_factory.mktemp("ride") / "out")


@pytest.fixture(scope="module")
def solved(bag: Path) -> SolvedRecording:
    return read_solved(bag)


@pytest.fixture(scope="module")
def text(bag: Path) -> str:
    with BagFile(bag) as opened:
        return published_robot(opened)


def test_our_segments_are_where_the_solver_had_the_segments(solved: SolvedRecording, ride: Walk) -> None:
    assert solved.body.segments == ride.body.segments
    for row, segment in enumerate(ride.body.segments):
        np.testing.assert_allclose(solved.world_T_link[segment], ride.world_T_segment[:, row], rtol=0.0, atol=EXACT)


def test_the_cranks_angle_goes_on_over_whole_turns(solved: SolvedRecording) -> None:
    angle = solved.joint_angles[:, solved.joint_names.index("crank")]
    assert angle[-1] - angle[0] == pytest.approx(2.0 * np.pi * TURNS)
    assert np.ptp(np.diff(angle)) < EXACT


def test_yourdfpy_agrees(solved: SolvedRecording, text: str, ride: Walk) -> None:
    model = yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False, build_scene_graph=True)
    assert model.validate() and model.base_link == "pelvis"
    for instant in range(0, len(solved.stamps_ns), 7):
        model.update_cfg(dict(zip(solved.joint_names, solved.joint_angles[instant], strict=True)))
        for row, segment in enumerate(ride.body.segments):
            pose = solved.world_T_root[instant] @ model.get_transform(segment)
            np.testing.assert_allclose(pose, ride.world_T_segment[instant, row], rtol=0.0, atol=EXACT)


def test_pinocchio_agrees(solved: SolvedRecording, text: str, ride: Walk) -> None:
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    for instant in range(0, len(solved.stamps_ns), 7):
        q = pinocchio.neutral(model)
        for name, angle in zip(solved.joint_names, solved.joint_angles[instant], strict=True):
            joint = model.joints[model.getJointId(name)]
            # Pinocchio keeps a joint without limits as cosine and sine.
            q[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        pinocchio.framesForwardKinematics(model, data, q)
        for row, segment in enumerate(ride.body.segments):
            pose = (
                solved.world_T_root[instant] @ data.oMf[model.getFrameId(segment, pinocchio.FrameType.BODY)].homogeneous
            )
            np.testing.assert_allclose(pose, ride.world_T_segment[instant, row], rtol=0.0, atol=EXACT)


def test_joint_rotations_say_where_the_equipment_is(bag: Path, ride: Walk) -> None:
    pelvis, frame = (ride.body.segment_index[segment] for segment in ("pelvis", "frame"))
    with BagFile(bag) as opened:
        messages = [message for _, _, message in opened.messages(["/joint_rotations"])]
    for poses, message in zip(ride.world_T_segment, messages, strict=True):
        said = message.transforms[message.joint_names.index("bicycle")]
        offset = np.array([said.translation.x, said.translation.y, said.translation.z])
        np.testing.assert_allclose(offset, (inverse(poses[pelvis]) @ poses[frame])[:3, 3], rtol=0.0, atol=EXACT)


def test_the_loop_that_the_tree_leaves_open_is_closed_by_the_angles(solved: SolvedRecording, ride: Walk) -> None:
    (pedal,) = ride.body.loop_joints
    on_crank = (solved.world_T_link[pedal.parent] @ pedal.parent_T_joint)[:, :3, 3]
    on_foot = (solved.world_T_link[pedal.child] @ pedal.child_T_joint)[:, :3, 3]
    np.testing.assert_allclose(on_crank, on_foot, rtol=0.0, atol=EXACT)
