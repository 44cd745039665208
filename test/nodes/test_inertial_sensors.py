"""Inertial sensors in the live graph, in processes: as good as in a replay, and states while no camera sends images."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.altered_sample import write_altered_sample
from helpers.live_graph import live_graph, player
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.geometry import log_so3
from bodycam_ros.inertial.imu_calibration import ImuCalibration
from bodycam_ros.inertial.imu_samples import GRAVITY
from bodycam_ros.messages.factory import Message, stamp_ns
from bodycam_ros.messages.imu import IMU_TOPIC, imu_message
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.replaying.replay import replay
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved

CAMERAS = ("waist_front", "torso_front", "thigh_left", "shin_left")
FRAMES, DARK = 60, range(39, 54)  # live, clocks are compared for a second before the first state
ANGLE_DEG, POSITION_M = 0.5, 0.005
RATE_HZ, RATE = 200.0, 0.25
LATENCY_S = 0.002  # of the sensors' stamps
_START_S, _PLAY_S, _SOON_S = 180.0, 300.0, 60.0


def write_sensors(target: Path, solved: SolvedRecording) -> Path:
    """What sensors of the cameras would feel on the paths of a solved recording."""
    make, seconds = recorded_messages(), 1e-9 * (solved.stamps_ns - solved.stamps_ns[0])
    at = np.arange(0.0, seconds[-1], 1.0 / RATE_HZ)
    stamps_ns = solved.stamps_ns[0] + np.rint(1e9 * (at + LATENCY_S)).astype(np.int64)
    rows = []
    for camera in CAMERAS:
        poses = solved.world_T_link[f"{camera}_optical_frame"]
        turning = RotationSpline(seconds, Rotation.from_matrix(poses[:, :3, :3]))
        before, R, after = (turning(at + off).as_matrix() for off in (-1e-4, 0.0, 1e-4))
        w = Rotation.from_matrix(np.swapaxes(before, 1, 2) @ after).as_rotvec() / 2e-4
        force = CubicSpline(seconds, poses[:, :3, 3])(at, 2) + [0.0, 0.0, GRAVITY]
        a = (np.swapaxes(R, 1, 2) @ force[..., None])[..., 0]
        rows += [(int(stamp), camera, *readings) for stamp, *readings in zip(stamps_ns, w, a, strict=True)]
    with write_recording(target) as writer:
        for stamp, camera, velocity, acceleration in sorted(rows, key=lambda row: row[:2]):
            writer.write(f"/{camera}{IMU_TOPIC}", stamp, imu_message(make, camera, stamp, velocity, acceleration))
    return target


@pytest.mark.long
def test_live_with_sensors_agrees_with_a_replay_while_all_cameras_are_dark(
    graph: Any, sample: Path, tmp_path: Path
) -> None:
    reference_map, settings = sample / "map", PipelineSettings()
    settings = replace(settings, estimator=replace(settings.estimator, output_delay=0))
    whole = write_altered_sample(sample, tmp_path / "whole", cameras=CAMERAS, frames=FRAMES)
    replay(ReplayRequest(whole, reference_map, sample / "body.yaml", tmp_path / "true", settings, jobs=2))
    true = read_solved(tmp_path / "true")
    sensors = write_sensors(tmp_path / "imu", true)
    person = read_body(sample / "body.yaml")
    sigmas = {"rotation_sigma": 1e-3, "position_sigma": 1e-3, "time_offset_sigma": 1e-4}
    biases = {"gyro_bias_sigma": 1e-3, "accelerometer_bias_sigma": 0.02}
    calibration = ImuCalibration(time_offset=LATENCY_S, **sigmas, **biases)
    mounts = {name: replace(m, imu=calibration) if name in CAMERAS else m for name, m in person.mounts.items()}
    body = tmp_path / "body.yaml"
    write_body(replace(person, mounts=mounts), body)

    def darken(topic: str, number: int, message: Message) -> Message | None:
        return None if number in DARK and "image_raw" in topic else message

    bag = write_altered_sample(sample, tmp_path / "bag", darken, CAMERAS, FRAMES)
    replay(ReplayRequest(bag, reference_map, body, tmp_path / "replayed", settings, jobs=2, imus=(sensors,)))
    replayed = read_solved(tmp_path / "replayed")

    graph.listen(
        {
            "/waist_front/landmarks": "bodycam_msgs/msg/LandmarkMatches",
            "/robot_description": "std_msgs/msg/String",
            "/joint_states": "sensor_msgs/msg/JointState",
            "/odometry": "nav_msgs/msg/Odometry",
            "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
        }
    )
    given: dict[str, dict[str, Any]] = {
        "tracker": {"longest_wait": 0.0},
        "skeleton_solver": {"estimator.output_delay": 0},
    }
    graph.start(
        *(
            replace(node, parameters={**node.parameters, **given.get(node.executable, {})})
            for node in live_graph(reference_map, body, CAMERAS)
        )
    )
    playing_node = player(bag, RATE, imu=str(sensors))
    (playing,) = graph.start(replace(playing_node, parameters={**playing_node.parameters, "reader_wait": _START_S}))
    dark_ns = [int(true.stamps_ns[frame]) for frame in DARK]
    carried: set[int] = set()

    def is_played() -> bool:
        if not any(
            stamp_ns(message.header.stamp) > dark_ns[-1] for message in graph.messages("/waist_front/landmarks", -1)
        ):
            carried.update(stamp_ns(message.header.stamp) for message in graph.messages("/joint_states", -8))
        return bool(playing.is_over)

    graph.until(is_played, _PLAY_S, "the bag is played")
    assert playing.end() == 0, graph.report()
    graph.until(lambda: len(graph.heard["/joint_states"]) >= FRAMES, _SOON_S, "a state for every frame")
    graph.until(lambda: graph.diagnostics("skeleton_solver: inertial sensors"), _SOON_S, "the solver reports")
    assert graph.diagnostics("skeleton_solver: inertial sensors")["text"] == f"{len(CAMERAS)} of {len(CAMERAS)} in use"
    tracker = graph.diagnostics("tracker_shin_left: camera shin_left")
    assert tracker["inertial sensor"] == "in use"
    assert set(graph.end().values()) == {0}, graph.report()

    in_time = sum(any(abs(stamp - dark) < 5_000_000 for stamp in carried) for dark in dark_ns)
    assert in_time >= len(DARK) - 3, "states come while there are no images, as late as with them"
    live = read_solved(graph.write(tmp_path / "live"))
    nearest = np.abs(live.stamps_ns[:, None] - replayed.stamps_ns).argmin(axis=1)
    apart_ns = np.abs(live.stamps_ns - replayed.stamps_ns[nearest])
    assert apart_ns.max() < 1_000_000
    dark = (live.stamps_ns >= dark_ns[0] - 1_000_000) & (live.stamps_ns <= dark_ns[-1] + 1_000_000)
    assert dark.sum() == len(DARK)
    of_true = np.abs(live.stamps_ns[:, None] - true.stamps_ns).argmin(axis=1)
    for link in (f"{camera}_optical_frame" for camera in CAMERAS):
        by_live = live.world_T_link[link]
        by_replay = replayed.world_T_link[link][nearest]
        at = true.world_T_link[link][of_true]
        turned = np.swapaxes(by_live[:, :3, :3], 1, 2) @ by_replay[:, :3, :3]
        assert np.degrees(np.linalg.norm(log_so3(turned), axis=1)).max() <= ANGLE_DEG, link
        apart_m = np.linalg.norm(by_live[:, :3, 3] - by_replay[:, :3, 3], axis=1)
        assert np.median(apart_m) <= POSITION_M, link
        errors_m = (np.linalg.norm(each[dark, :3, 3] - at[dark, :3, 3], axis=1).mean() for each in (by_live, by_replay))
        live_m, replay_m = errors_m
        assert live_m <= 1.5 * replay_m + 2.0 * POSITION_M, link
