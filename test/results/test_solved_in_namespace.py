"""What was recorded of a person who has a namespace is read as that of one who has none."""

from pathlib import Path

import numpy as np
from helpers.naming import naming
from rosbags.highlevel import AnyReader

from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recording_typestore
from bodycam_ros.results.solved_recording import read_solved

_OF_ROBOT = ("/robot_description", "/joint_states", "/odometry")


def _recorded(solved: Path, folder: Path, *namespaces: str) -> Path:
    """The same bag, said in namespaces, beside a robot and a neighbour of a longer name."""
    with AnyReader([solved], default_typestore=recording_typestore()) as bag, write_recording(folder) as writer:
        for connection, stamp_ns, cdr in bag.messages():
            for namespace in namespaces:
                writer.write_serialized(f"{namespace}{connection.topic}", connection.msgtype, stamp_ns, bytes(cdr))
            if connection.topic == "/robot_description":
                # robot_state_publisher says it again; a robot that follows has joints, too.
                again = f"{namespaces[0]}/robot_state_publisher{connection.topic}"
                writer.write_serialized(again, connection.msgtype, stamp_ns, bytes(cdr))
            if connection.topic in _OF_ROBOT:
                writer.write_serialized(f"/spot{connection.topic}", connection.msgtype, stamp_ns, bytes(cdr))
            if connection.topic == "/odometry":
                neighbour = f"{namespaces[0]}_too{connection.topic}"
                writer.write_serialized(neighbour, connection.msgtype, stamp_ns, bytes(cdr))
    return folder


def test_the_body_of_a_namespace_is_read(sample_out: Path, tmp_path: Path) -> None:
    alone = read_solved(sample_out)
    of_anna = read_solved(_recorded(sample_out, tmp_path / "anna", "/team/anna"))
    assert np.array_equal(of_anna.stamps_ns, alone.stamps_ns)
    assert np.array_equal(of_anna.joint_angles, alone.joint_angles)
    assert [each.camera for each in of_anna.cameras] == [each.camera for each in alone.cameras]
    camera = alone.cameras[0].camera
    ours, theirs = (next(iter(each.landmarks([camera]))) for each in (alone, of_anna))
    assert ours.stamp_ns == theirs.stamp_ns and np.array_equal(ours.landmark_ids, theirs.landmark_ids)
    with BagFile(tmp_path / "anna") as bag, BagFile(sample_out) as before:
        assert {"/spot/joint_states", "/team/anna_too/odometry"} <= bag.topics.keys(), "nobody else's"
        assert bag.message_count("/joint_states") == before.message_count("/joint_states") > 0


def test_of_two_people_nobody_is_chosen(sample_out: Path, tmp_path: Path) -> None:
    with naming(RecordingError, tmp_path / "both", "/robot_description", "/anna/joint_states", "/ben/joint_states"):
        read_solved(_recorded(sample_out, tmp_path / "both", "/anna", "/ben"))
