"""What cannot be evaluated is refused with the name of what is wrong, and leaves nothing behind."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.known_walk import START_NS, Walk, write_solved, write_truth

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.messages.body import joint_state_message
from bodycam_ros.messages.diagnostics import text_message
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages, recording_typestore


def complaint(out: Path, truth: Path | None = None) -> str:
    with pytest.raises(RecordingError) as caught:
        evaluate(out, truth)
    return str(caught.value)


def test_no_bag_at_all(tmp_path: Path) -> None:
    assert complaint(tmp_path / "nowhere") == f"{tmp_path / 'nowhere'}: does not exist"
    (tmp_path / "notes.txt").write_text("hello")
    assert "is not a bag" in complaint(tmp_path / "notes.txt")


def test_a_recording_that_was_not_solved_is_told_from_a_solved_one(tiny_bag: Path) -> None:
    text = complaint(tiny_bag)
    assert "no topic /robot_description" in text and "bodycam replay" in text and "/left/camera_info" in text


@pytest.mark.parametrize("topic", ["/robot_description", "/joint_states", "/odometry"])
def test_a_missing_topic_is_named(walk: Walk, tmp_path: Path, topic: str) -> None:
    assert f"no topic {topic};" in complaint(write_solved(walk, tmp_path / "out", leave_out=(topic,)))


def test_missing_registrations_are_named(walk: Walk, tmp_path: Path) -> None:
    out = write_solved(walk, tmp_path / "out", leave_out=("/waist/landmarks", "/shin/landmarks"))
    assert "no topic /<camera>/landmarks" in complaint(out)


def test_registrations_of_another_version_are_named(walk: Walk, tmp_path: Path) -> None:
    """Their messages had fewer fields, so that none of them can be decoded."""
    make = recorded_messages()
    short = bytes(recording_typestore().serialize_cdr(make("std_msgs/msg/Empty"), "std_msgs/msg/Empty"))
    solved = write_solved(walk, tmp_path / "solved", leave_out=("/waist/landmarks", "/shin/landmarks"))
    with BagFile(solved) as bag, write_recording(tmp_path / "older") as writer:
        for topic, stamp_ns, message in bag.messages(bag.topics):
            writer.write(topic, stamp_ns, message)
        writer.write_serialized("/waist/landmarks", "bodycam_msgs/msg/LandmarkMatches", START_NS, short)
    assert "no message on /<camera>/landmarks can be read; another version" in complaint(tmp_path / "older")


def test_tracks_are_not_needed(walk: Walk, tmp_path: Path) -> None:
    out = write_solved(walk, tmp_path / "out", leave_out=("/waist/tracks",))
    assert evaluate(out).figures.cameras["waist"].landmarks > 0.0


def test_a_topic_of_another_type_is_named(tmp_path: Path) -> None:
    with write_recording(tmp_path / "out") as writer:
        writer.write("/robot_description", START_NS, text_message(recorded_messages(), "<robot/>"))
        writer.write("/joint_states", START_NS, text_message(recorded_messages(), "bent"))
    assert "/joint_states is std_msgs/msg/String, expected sensor_msgs/msg/JointState" in complaint(tmp_path / "out")


def test_joint_states_of_another_body_are_refused(walk: Walk, tmp_path: Path) -> None:
    make = recorded_messages()
    foreign = joint_state_message(make, START_NS, ["tail"], np.zeros(1), np.zeros(1))
    out = write_solved(
        walk, tmp_path / "out", leave_out=("/joint_states",), more=[("/joint_states", START_NS, foreign)]
    )
    assert "/joint_states lacks spine_y, spine_z" in complaint(out)


def test_joint_states_that_contradict_themselves_are_named(walk: Walk, tmp_path: Path) -> None:
    names = [name for joint in walk.body.tree_joints for name in joint.angle_names]
    short = joint_state_message(recorded_messages(), START_NS, names, np.zeros(3), np.zeros(3))
    out = write_solved(walk, tmp_path / "out", leave_out=("/joint_states",), more=[("/joint_states", START_NS, short)])
    assert "a message on /joint_states contradicts itself" in complaint(out)


def test_states_without_odometry_of_their_stamps_are_refused(walk: Walk, tmp_path: Path) -> None:
    names = [name for joint in walk.body.tree_joints for name in joint.angle_names]
    angles = np.zeros(len(names))
    late = joint_state_message(recorded_messages(), START_NS + 7, names, angles, angles)
    out = write_solved(walk, tmp_path / "out", leave_out=("/joint_states",), more=[("/joint_states", START_NS, late)])
    assert "none of 1 /joint_states has an /odometry of the same stamp" in complaint(out)


def test_states_that_are_not_finite_do_not_count(walk: Walk, tmp_path: Path) -> None:
    names = [name for joint in walk.body.tree_joints for name in joint.angle_names]
    stamp_ns = int(walk.stamps_ns[5])
    broken = joint_state_message(
        recorded_messages(), stamp_ns, names, np.full(len(names), np.nan), np.zeros(len(names))
    )
    out = write_solved(walk, tmp_path / "out", more=[("/joint_states", stamp_ns, broken)])
    assert len(evaluate(out).solved.stamps_ns) == len(walk.stamps_ns) - 1


def test_one_single_instant_is_enough(walk: Walk, tmp_path: Path) -> None:
    evaluation = evaluate(write_solved(walk.without(list(range(1, 60))), tmp_path / "out"))
    assert len(evaluation.solved.stamps_ns) == 1
    assert np.isnan(evaluation.jitter).all()


def test_the_truth_of_another_recording_shares_no_time(walk: Walk, solved: Path, tmp_path: Path) -> None:
    another = write_truth(replace(walk, stamps_ns=walk.stamps_ns + 3_600 * 10**9), tmp_path / "another")
    text = complaint(solved, another)
    assert "is the truth of another recording" in text and "1700003600.000" in text


def test_the_truth_of_another_body_shares_no_segments(solved: Path, truth: Path, tmp_path: Path) -> None:
    folder = tmp_path / "another" / "truth" / "segments"
    folder.mkdir(parents=True)
    (folder / "tail.tum").write_text((truth / "truth" / "segments" / "pelvis.tum").read_text())
    (tmp_path / "another" / "rig.yaml").write_text("segments: {rump: null, tail: rump}")
    assert "share too little to be aligned: segments none" in complaint(solved, tmp_path / "another")


def test_the_truth_may_be_named_by_either_folder(solved: Path, truth: Path) -> None:
    for folder in (truth, truth / "truth"):
        comparison = evaluate(solved, folder).comparison
        assert comparison is not None and comparison.truth_name == "walk"


@pytest.mark.parametrize(
    ("file", "content", "expected"),
    [
        (
            "truth/segments/pelvis.tum",
            "1.0 2.0\n",
            "pelvis.tum: cannot be read as a trajectory in TUM format: line 1: expected 8",
        ),
        ("truth/segments/pelvis.tum", "x 0 0 0 0 0 0 1\n" * 2, "pelvis.tum: cannot be read"),
        ("truth/segments/pelvis.tum", "1.0 0 0 0 0 0 0 1\n" * 2, "increasing stamps"),
        ("truth/segments/pelvis.tum", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 0\n", "pelvis.tum: cannot be read"),
        ("truth/segments/pelvis.tum", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n", "has other stamps"),
        ("rig.yaml", "cameras: {}", "rig.yaml: expected a table segments"),
        ("rig.yaml", "segments: {a: null, b: null}", "one segment has no parent (null), not 2: a, b"),
        ("rig.yaml", "segments: {a: null, b: a}", "none of its files is named as a segment"),
        ("rig.yaml", None, "no rig.yaml in it or beside it"),
        ("truth", None, "no ground truth"),
    ],
)
def test_malformed_truth_is_named(
    walk: Walk, solved: Path, tmp_path: Path, file: str, content: str | None, expected: str
) -> None:
    folder = write_truth(walk, tmp_path / "walk")
    if content is None:
        (folder / file).rename(folder / "gone")
    else:
        (folder / file).write_text(content)
    assert expected in complaint(solved, folder)


def test_a_trajectory_that_is_a_pipe_is_not_waited_for(walk: Walk, solved: Path, tmp_path: Path) -> None:
    pipe = write_truth(walk, tmp_path / "walk") / "truth" / "segments" / "pelvis.tum"
    pipe.unlink()
    os.mkfifo(pipe)
    assert "pelvis.tum: cannot read this trajectory: it is a folder, pipe" in complaint(solved, tmp_path / "walk")
