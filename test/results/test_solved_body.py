"""A walk that is known exactly, written as a replay would and read back; and bags that lack what a walk needs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import FRAME_NS, FRAMES, LOST, ROOT_SIGMA_M, ROOT_SIGMA_RAD, START_NS, Walk, write_solved
from helpers.naming import naming

from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.camera.model import optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import inverse
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.messages.diagnostics import text_message
from bodycam_ros.messages.timing import timing_message
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.results.solved_body import SolvedBody, plain_name, read_solved_body
from bodycam_ros.results.solved_recording import read_solved
from bodycam_ros.timing.clock_state import ClockState


@pytest.fixture(scope="module")
def bag(walk: Walk, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_solved(walk, tmp_path_factory.mktemp("walk") / "out")


@pytest.fixture(scope="module")
def solved(bag: Path) -> SolvedBody:
    return read_solved_body(bag)


def test_poses_of_all_segments_and_cameras_are_those_that_were_solved(solved: SolvedBody, walk: Walk) -> None:
    np.testing.assert_array_equal(solved.stamps_ns, walk.stamps_ns)
    assert solved.body.segments == walk.body.segments == solved.body_segments
    np.testing.assert_allclose(solved.world_T_segment, walk.world_T_segment, atol=1e-9)
    for camera, mount in walk.body.mounts.items():
        expected = walk.world_T_segment[:, walk.body.segment_index[mount.segment]] @ mount.segment_T_camera
        np.testing.assert_allclose(solved.world_T_link[optical_frame(camera)], expected, atol=1e-9)
    assert solved.placed.all() and solved.equipment is None
    expected = np.diag([ROOT_SIGMA_RAD**2] * 3 + [ROOT_SIGMA_M**2] * 3)
    np.testing.assert_allclose(solved.root_covariance, np.tile(expected, (FRAMES, 1, 1)), atol=1e-15)


def test_a_time_between_two_states_is_between_their_poses(solved: SolvedBody) -> None:
    halfway = solved.segments_near(START_NS + FRAME_NS // 2)
    np.testing.assert_allclose(halfway[:, :3, 3], solved.world_T_segment[:2, :, :3, 3].mean(axis=0), atol=1e-6)
    np.testing.assert_allclose(solved.segments_near(START_NS - 10**9), solved.world_T_segment[0], atol=1e-12)


def _rewritten(bag: Path, out: Path, change) -> Path:
    """The bag with each message changed, or left out where ``change`` has None for it."""
    with BagFile(bag) as opened, write_recording(out) as writer:
        for topic, stamp_ns, message in opened.messages(opened.topics):
            if (changed := change(topic, stamp_ns, message)) is not None:
                writer.write(topic, stamp_ns, changed)
    return out


def test_angles_of_a_body_that_turns_on_count_its_turns(bag: Path, solved: SolvedBody, tmp_path: Path) -> None:
    """Balls are published within a turn; files of motion count on, or a curve would jump."""
    column = solved.joint_names.index("spine_z")
    true = 0.3 * np.arange(FRAMES)

    def turned(topic: str, stamp_ns: int, message):
        if topic == "/joint_states":
            angle = true[(stamp_ns - START_NS) // FRAME_NS]
            within = np.arctan2(np.sin(angle), np.cos(angle))
            message.position = np.where(np.arange(len(message.position)) == column, within, message.position)
        return message

    angles = read_solved_body(_rewritten(bag, tmp_path / "turned", turned)).joint_angles
    np.testing.assert_allclose(angles[:, column], true, atol=1e-9)
    others = np.arange(len(solved.joint_names)) != column
    np.testing.assert_allclose(angles[:, others], solved.joint_angles[:, others], atol=1e-9)


def test_states_that_are_not_whole_are_left_out(bag: Path, tmp_path: Path) -> None:
    def change(topic: str, stamp_ns: int, message):
        frame = (stamp_ns - START_NS) // FRAME_NS
        if topic == "/odometry" and frame == 5:
            return None
        if topic == "/joint_states" and frame == 7:
            message.position = np.where(np.arange(len(message.position)) == 2, np.nan, message.position)
        if topic == "/odometry" and frame == 9:
            message.pose.pose.position.x = np.inf
        return message

    solved = read_solved_body(_rewritten(bag, tmp_path / "odd", change))
    kept = np.setdiff1d(np.arange(FRAMES), [5, 7, 9])
    np.testing.assert_array_equal((solved.stamps_ns - START_NS) // FRAME_NS, kept)


def test_a_bag_of_whose_states_none_is_whole_is_named(bag: Path, tmp_path: Path) -> None:
    def late(topic: str, stamp_ns: int, message):
        if topic == "/odometry":
            message.header.stamp.sec += 1000
        return message

    out = _rewritten(bag, tmp_path / "late", late)
    with naming(RecordingError, out, "/joint_states", "/odometry", FRAMES):
        read_solved_body(out)


@pytest.mark.parametrize("topic", ["/robot_description", "/joint_states", "/odometry"])
def test_a_topic_that_is_missing_is_named_with_those_that_are_there(walk: Walk, tmp_path: Path, topic: str) -> None:
    out = write_solved(walk, tmp_path / "out", leave_out=(topic,))
    others = {"/robot_description", "/joint_states", "/odometry", "/waist/landmarks"} - {topic}
    with naming(RecordingError, out, topic, *others):
        read_solved_body(out)


def test_a_topic_of_another_type_is_named_with_both(walk: Walk, tmp_path: Path) -> None:
    odd = ("/odometry", START_NS, text_message(recorded_messages(), "here"))
    out = write_solved(walk, tmp_path / "out", leave_out=("/odometry",), more=[odd])
    with naming(RecordingError, out, "/odometry", "std_msgs/msg/String", "nav_msgs/msg/Odometry"):
        read_solved_body(out)


def test_joint_states_of_another_body_are_named_with_their_joints(walk: Walk, tmp_path: Path) -> None:
    tail = Joint("tail", "pelvis", "tail", "hinge", np.eye(4))
    more = replace(walk.body, segments=(*walk.body.segments, "tail"), joints=(*walk.body.joints, tail))
    out = write_solved(walk, tmp_path / "out", published=more)
    with naming(RecordingError, out, "/joint_states", "tail", "/robot_description"):
        read_solved_body(out)


def test_the_last_description_counts(walk: Walk, tmp_path: Path) -> None:
    again = text_message(recorded_messages(), urdf_text(replace(walk.body, name="renamed")))
    out = write_solved(walk, tmp_path / "out", more=[("/robot_description", START_NS + FRAMES * FRAME_NS, again)])
    assert read_solved_body(out).body.name == "renamed"
    damaged = text_message(recorded_messages(), "<robot")
    out = write_solved(walk, tmp_path / "bad", more=[("/robot_description", START_NS + FRAMES * FRAME_NS, damaged)])
    with naming(RecordingError, out, "/robot_description"):
        read_solved_body(out)


def test_a_bag_is_named_by_its_folder_or_its_file(bag: Path) -> None:
    (file,) = bag.glob("*.mcap")
    assert plain_name(bag) == "out" and plain_name(file) == file.stem


def test_registrations_are_those_that_were_recorded(bag: Path, walk: Walk) -> None:
    recording = read_solved(bag)
    assert [record.camera for record in recording.cameras] == list(walk.body.mounts)
    for record in recording.cameras:
        lost = np.isin(np.arange(FRAMES), LOST[record.camera])
        np.testing.assert_array_equal(record.registered, ~lost)
        between = inverse(recording.world_T_link[optical_frame(record.camera)]) @ record.world_T_camera
        np.testing.assert_allclose(between[~lost], np.tile(np.eye(4), (sum(~lost), 1, 1)), atol=1e-6)
    assert recording.stored_verdict is None and recording.stations == ()


def test_a_clock_that_is_ahead_is_put_right(walk: Walk, tmp_path: Path) -> None:
    ahead_s = 0.04
    clock = ClockState(START_NS, START_NS, ahead_s, 0.0, 0.001, 0.0)
    timing = timing_message(recorded_messages(), "shin", "body", None, clock)
    for name, more in (("unknown", []), ("known", [("/shin/timing", START_NS, timing)])):
        bag = write_solved(walk, tmp_path / name, clocks_ns={"shin": round(1e9 * ahead_s)}, more=more)
        recording = read_solved(bag)
        given = {record.camera: record for record in recording.cameras}
        ahead_ns = 0 if more else round(1e9 * ahead_s)
        np.testing.assert_array_equal(given["shin"].stamps_ns - given["waist"].stamps_ns, ahead_ns)
        assert {matches.stamp_ns for matches in recording.landmarks(["shin"])} == set(given["shin"].stamps_ns.tolist())
        assert (given["shin"].timing is None) == (not more)


def test_gaps_are_steps_of_more_than_a_frame_and_a_half(walk: Walk, tmp_path: Path) -> None:
    recording = read_solved(write_solved(walk.without([20, 21, 40]), tmp_path / "out"))
    assert recording.frame_ns == recording.step_ns == FRAME_NS
    assert recording.duration_s == pytest.approx(FRAMES * FRAME_NS * 1e-9)
    frames = np.array([-1, 0, 10, 19, 20, 30, 40, 59, 60])
    solved = recording.is_solved_at(START_NS + frames * FRAME_NS)
    assert solved.tolist() == [False, True, True, False, False, True, False, True, False]
    seconds, values = recording.curve(recording.stamps_ns, np.arange(float(len(recording.stamps_ns))))
    assert np.isnan(seconds).sum() == np.isnan(values).sum() == 2
    assert np.flatnonzero(np.isnan(values)).tolist() == [20, 39]
