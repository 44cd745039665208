"""The offline replay on real images: deterministic, complete and right."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from helpers.altered_sample import write_altered_sample

from bodycam_ros.body.body_file import read_body
from bodycam_ros.errors import MapError
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.evaluate.comparison import compare, read_true_motion
from bodycam_ros.messages.factory import stamp_ns, time_message
from bodycam_ros.messages.tracks import landmark_matches, track_frame
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.replaying.replay import replay
from bodycam_ros.replaying.replay_remarks import clock_remarks
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.results.solved_recording import read_solved
from bodycam_ros.timing.frame_assembler import AssemblerSettings


@pytest.fixture(scope="module")
def short(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight frames of three cameras."""
    return write_altered_sample(sample, tmp_path_factory.mktemp("short") / "bag")


def joint_states(out: Path) -> dict[int, tuple[list[str], np.ndarray]]:
    """Stamp -> names and positions."""
    with BagFile(out) as bag:
        return {
            stamp: (list(message.name), np.array(message.position))
            for _, stamp, message in bag.messages(["/joint_states"])
        }


def test_two_runs_give_identical_joint_states_whatever_the_number_of_processes(
    sample: Path, short: Path, tmp_path: Path
) -> None:
    for name, jobs in (("one", 1), ("two", 2)):
        replay(ReplayRequest(short, sample / "map", sample / "body.yaml", tmp_path / name, PipelineSettings(), jobs))
    one, two = joint_states(tmp_path / "one"), joint_states(tmp_path / "two")
    assert list(one) == list(two)
    assert len(one) == 8
    for stamp in one:
        assert one[stamp][0] == two[stamp][0]
        assert np.array_equal(one[stamp][1], two[stamp][1])


def test_a_recording_is_solved_as_a_whole_in_a_step_of_its_own(sample: Path, short: Path, tmp_path: Path) -> None:
    settings = PipelineSettings(estimator=EstimatorSettings(output_delay="offline"))
    steps: list[tuple[str, float]] = []
    inputs = (short, sample / "map", sample / "body.yaml")
    summary = replay(
        ReplayRequest(*inputs, tmp_path / "whole", settings, 1), on_step=lambda step, share: steps.append((step, share))
    )
    replay(ReplayRequest(*inputs, tmp_path / "forward", PipelineSettings(), 1))
    whole, forward = joint_states(tmp_path / "whole"), joint_states(tmp_path / "forward")
    assert summary.solved == 8 and list(whole) == list(forward)
    # What the three cameras see; of the other limbs the whole recording has another opinion.
    seen = [number for number, name in enumerate(whole[min(whole)][0]) if name.startswith(("spine", "hip_left"))]
    gaps = [np.abs(whole[stamp][1] - forward[stamp][1])[seen].max() for stamp in whole]
    assert len(seen) == 6 and 0.0 < max(gaps) < 0.005
    assert list(dict(steps)) == [f"replay of {summary.recorded_s:.1f} s", "all frames together"] and steps[-1][1] == 1.0


@pytest.mark.long
def test_a_camera_that_starts_late_costs_the_others_nothing(sample: Path, tmp_path: Path) -> None:
    def late(topic: str, number: int, message: object) -> object:
        return None if topic == "/thigh_left/image_raw/compressed" and number < 40 else message

    bag = write_altered_sample(sample, tmp_path / "bag", late, frames=45)
    settings = PipelineSettings(assembler=AssemblerSettings(max_wait=0.5))
    for name, jobs in (("one", 1), ("three", 3)):
        summary = replay(ReplayRequest(bag, sample / "map", sample / "body.yaml", tmp_path / name, settings, jobs))
        assert (summary.solved, summary.late) == (45, 0)
        assert dict(summary.images) == {"waist_front": 45, "torso_front": 45, "thigh_left": 5}
    one, three = joint_states(tmp_path / "one"), joint_states(tmp_path / "three")
    assert all(np.array_equal(one[stamp][1], three[stamp][1]) for stamp in one)


def test_a_camera_that_is_late_is_found_named_and_corrected(sample: Path, tmp_path: Path) -> None:
    """Two seconds of four cameras, one of them with stamps that are 20 ms ahead."""
    cameras = ("waist_front", "torso_front", "thigh_left", "shin_left")

    def late(topic: str, number: int, message: Any) -> Any:
        if topic != "/shin_left/image_raw/compressed":
            return message
        stamp = time_message(recorded_messages(), stamp_ns(message.header.stamp) + 20_000_000)
        return replace(message, header=replace(message.header, stamp=stamp))

    angles = {}
    for name, alter in (("late", late), ("right", lambda topic, number, message: message)):
        bag = write_altered_sample(sample, tmp_path / f"{name}_bag", alter, cameras, frames=60)
        summary = replay(
            ReplayRequest(bag, sample / "map", sample / "body.yaml", tmp_path / name, PipelineSettings(), jobs=2)
        )
        assert summary.solved == 60 and not any(timing.jumps for timing in summary.timings.values())
        solved = read_solved(tmp_path / name)
        angles[name] = solved.joint_angles
        (shin,) = (record for record in solved.cameras if record.camera == "shin_left")
        assert shin.timing is not None
        told = summary.timings["shin_left"].latest
        assert shin.timing.latest.offset_sigma == told.offset_sigma
        if name == "late":
            assert shin.timing.is_off
            assert shin.timing.latest.offset == pytest.approx(0.02, abs=min(0.008, 3.0 * told.offset_sigma))
            (remark,) = clock_remarks(summary.timings, summary.speeds)
            assert remark.startswith("camera shin_left: clock offset +")
        else:
            assert not any(timing.is_off for timing in summary.timings.values())
    assert np.degrees(np.abs(angles["late"] - angles["right"])).mean() < 0.3


def test_writes_the_whole_wire_contract(sample: Path, short: Path, tmp_path: Path) -> None:
    summary = replay(
        ReplayRequest(short, sample / "map", sample / "body.yaml", tmp_path / "out", PipelineSettings(), jobs=1)
    )
    assert (summary.frames, summary.solved, summary.predicted) == (8, 8, 0)
    assert set(summary.images.values()) == {8}
    body = read_body(sample / "body.yaml")
    with BagFile(tmp_path / "out") as bag:
        types = bag.topics
        assert {topic: types[topic] for topic in types if not topic.startswith(("/waist", "/torso", "/thigh"))} == {
            "/robot_description": "std_msgs/msg/String",
            "/map/points": "sensor_msgs/msg/PointCloud2",
            "/joint_states": "sensor_msgs/msg/JointState",
            "/joint_rotations": "sensor_msgs/msg/MultiDOFJointState",
            "/joint_covariances": "bodycam_msgs/msg/JointCovariances",
            "/odometry": "nav_msgs/msg/Odometry",
            "/tf": "tf2_msgs/msg/TFMessage",
            "/skeleton": "visualization_msgs/msg/MarkerArray",
            "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
            "/verdict": "std_msgs/msg/String",
        }
        assert types["/waist_front/timing"] == "bodycam_msgs/msg/CameraTiming"
        for topic in ("/waist_front/tracks", "/waist_front/landmarks", "/waist_front/pose"):
            assert bag.message_count(topic) == 8
        _, _, tracks = next(iter(bag.messages(["/waist_front/tracks"])))
        _, _, matches = next(iter(bag.messages(["/waist_front/landmarks"])))
        frame, named = track_frame(tracks, "waist_front"), landmark_matches(matches, "waist_front")
        assert frame.keyframe and len(frame.described) == len(frame.track_ids) > 100
        assert set(named.track_ids.tolist()) <= set(frame.track_ids.tolist())
        odometry = [message for _, _, message in bag.messages(["/odometry"])]
    assert {(m.header.frame_id, m.child_frame_id) for m in odometry} == {("map", body.root)}
    covariance = np.array(odometry[-1].pose.covariance).reshape(6, 6)
    assert np.linalg.eigvalsh(covariance).min() > 0
    assert 1e-4 < np.sqrt(covariance[0, 0]) < 0.05


def test_the_sample_comes_out_right(sample: Path, sample_out: Path) -> None:
    """Joint positions against the truth that the sample carries for scoring, after one rigid alignment."""
    comparison = compare(read_solved(sample_out), read_true_motion(sample / "sample"))
    assert comparison.coverage >= 0.98
    assert len(comparison.segments) == 13
    assert comparison.position_errors.mean() < 0.005
    assert comparison.position_errors.max() < 0.02
    assert np.degrees(comparison.tilt) < 0.2
    rotation_errors = [errors.mean() for errors in comparison.rotation_errors.values()]
    assert np.degrees(np.mean(rotation_errors)) < 0.3


def test_replay_starts_without_scipy() -> None:
    """Its parts are loaded when one is used: all of them take as long to load as everything else together."""
    command = "import sys, bodycam_ros.replaying.replay; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True).stdout.split()
    assert not {"scipy.linalg", "scipy.sparse", "scipy.spatial", "scipy.optimize", "scipy.interpolate"} & {*loaded}


def test_a_map_that_was_extended_in_vain_is_named_as_it_was_given(sample: Path, tmp_path: Path) -> None:
    grey = cv2.imencode(".jpg", np.full((480, 640), 90, np.uint8))[1].ravel()

    def without_detail(topic: str, number: int, message: Any) -> Any:
        if topic.endswith("compressed"):
            message.data = grey
        return message

    bag = write_altered_sample(sample, tmp_path / "bag", without_detail, ("waist_front",), frames=3)
    request = ReplayRequest(bag, sample / "map", sample / "body.yaml", tmp_path / "out", jobs=1, passes=2)
    with pytest.raises(MapError) as raised:
        replay(request)
    assert f"in {sample / 'map'}," in str(raised.value)
    assert not (tmp_path / "out").exists()
