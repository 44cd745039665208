"""Movements read from bags, against the robot that the bag describes and the bag's own transforms."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import FRAMES, Walk, walking_body, write_solved
from helpers.naming import naming
from helpers.ride_with_open_joints import UNPLACED, write_held
from numpy.testing import assert_allclose

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.stick_figure import body_bones
from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.results.body_motion import nearest
from bodycam_ros.results.solved_recording import read_solved
from bodycam_ros.viewer.motion import Motion, read_motion
from bodycam_ros.viewer.scene import segment_bones


@pytest.fixture(scope="module")
def body(sample: Path) -> BodyModel:
    return read_body(sample / "body.yaml")


@pytest.fixture(scope="module")
def motion(sample_out: Path, body: BodyModel) -> Motion:
    return read_motion(sample_out, body)


def test_segments_are_where_the_urdf_of_the_bag_puts_them(motion: Motion, sample_out: Path, body: BodyModel) -> None:
    solved = read_solved(sample_out)
    assert np.array_equal(motion.stamps_ns, solved.stamps_ns)
    for instant in (0, len(motion.stamps_ns) // 2, len(motion.stamps_ns) - 1):
        for segment, world_T_segment in zip(body.segments, motion.segments_at(body, instant), strict=True):
            assert_allclose(world_T_segment, solved.world_T_link[segment][instant], rtol=0.0, atol=1e-8)


def test_cameras_are_registered_where_the_landmarks_say_so(motion: Motion, sample_out: Path) -> None:
    for record in read_solved(sample_out).cameras:
        for instant, stamp in enumerate(motion.stamps_ns):
            row = nearest(record.stamps_ns, int(stamp), motion.frame_ns // 2)
            expected = None if row is None or not record.registered[row] else record.world_T_camera[row]
            found = motion.registered_at(record.camera, instant)
            assert (found is None) == (expected is None)
            if found is not None and expected is not None:
                assert_allclose(found, expected, rtol=0.0, atol=1e-6)


def test_the_slider_finds_the_nearest_instant(motion: Motion) -> None:
    seconds = motion.seconds
    assert motion.state_at(-1.0) == 0
    assert motion.state_at(99.0) == len(seconds) - 1
    assert motion.state_at(float(0.6 * seconds[7] + 0.4 * seconds[8])) == 7
    assert motion.state_at(float(0.4 * seconds[7] + 0.6 * seconds[8])) == 8


def test_without_a_bag_the_body_stands_on_the_floor_with_its_arms_down(body: BodyModel) -> None:
    motion = Motion.standing(body)
    world_T_segment = motion.segments_at(body, 0)
    assert_allclose(world_T_segment[:, :3, :3], np.tile(np.eye(3), (len(body.segments), 1, 1)), atol=1e-15)
    ends = [
        (world_T_segment[body.segment_index[segment]] @ np.append(end, 1.0))[2]
        for segment, *both in segment_bones(body)
        for end in both
    ]
    assert min(ends) == pytest.approx(0.0, abs=1e-12)
    assert 1.4 < max(ends) < 2.0
    assert motion.registered == {}


def test_a_bag_of_another_body_says_what_differs(sample_out: Path, rider: BodyModel) -> None:
    with naming(BodyError, sample_out, rider.name, "knee_left_x") as error:
        read_motion(sample_out, rider)
    assert str(sample_out) in str(error.value)


def test_a_bag_of_a_body_with_more_joints_is_named(sample_out: Path, body: BodyModel) -> None:
    stiff = replace(body, joints=tuple(replace(j, type="weld", limits=None) for j in body.joints))
    with naming(BodyError, "knee_left_x"):
        read_motion(sample_out, stiff)


def test_a_recording_is_no_solved_bag(sample: Path, body: BodyModel) -> None:
    with naming(RecordingError, sample / "sample" / "bag", "/robot_description", "bodycam replay"):
        read_motion(sample / "sample" / "bag", body)


def test_nearest_keeps_its_distance() -> None:
    stamps = np.array([10, 20, 40], dtype=np.int64)
    assert nearest(stamps, 22, 2) == 1
    assert nearest(stamps, 30, 9) is None
    assert nearest(np.zeros(0, np.int64), 30, 9) is None


def test_equipment_is_shown_beside_a_body_file_that_does_not_know_it(ride: Walk, tmp_path: Path) -> None:
    out = write_solved(ride, tmp_path / "out")
    motion = read_motion(out, walking_body())
    assert motion.angle_names == JointAngles(walking_body()).names
    (line,) = motion.equipment
    (pedal,) = ride.body.loop_joints
    foot = ride.world_T_segment[:, ride.body.segment_index["foot_left"]]
    assert_allclose(line.end, (foot @ pedal.child_T_joint)[:, :3, 3], rtol=0.0, atol=1e-9)
    for row, pose in enumerate(motion.segments_at(walking_body(), 20)):
        assert_allclose(pose, ride.world_T_segment[20, row], rtol=0.0, atol=1e-9)
    # A body file that has the equipment itself shows it itself.
    coupled = read_motion(out, ride.body)
    assert coupled.equipment == ()
    assert_allclose(coupled.segments_at(ride.body, 20), ride.world_T_segment[20], rtol=0.0, atol=1e-9)
    (own,) = (limb for limb in body_bones(ride.body, ride.world_T_segment[20]) if limb.is_equipment)
    assert_allclose(own.end[0], line.end[20], rtol=0.0, atol=1e-9)


def test_equipment_is_there_once_it_is_known_where_it_is(ride: Walk, tmp_path: Path) -> None:
    motion = read_motion(write_held(ride, tmp_path / "out"), walking_body())
    shown = [bool(motion.equipment_at(instant)) for instant in range(len(motion.stamps_ns))]
    assert shown == [instant not in UNPLACED for instant in range(FRAMES)]


def test_a_body_of_another_shape_is_still_named_beside_equipment(ride: Walk, tmp_path: Path) -> None:
    stiff = replace(walking_body(), joints=tuple(replace(j, type="weld") for j in walking_body().joints))
    with naming(BodyError, tmp_path / "out", "knee_left") as error:
        read_motion(write_solved(ride, tmp_path / "out"), stiff)
    assert "bicycle" not in str(error.value)
