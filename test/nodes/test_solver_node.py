"""The solver alone, fed with registrations of a known motion: what waits is published in the end."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from two_cameras import write_body

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import rigid
from bodycam_ros.messages.factory import numbers
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.messages.tracks import landmarks_message
from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.solving.smoother_settings import SmootherSettings

FRAME_NS = 33_333_333
START_NS = 1_000_000_000
SPEED = 0.5  # m/s, along x
_START_S, _SOON_S = 60.0, 20.0


def _registrations(body: BodyModel, frames: range) -> Iterator[LandmarkMatches]:
    """Of a body in the N-pose that moves steadily."""
    for frame in frames:
        stamp = START_NS + frame * FRAME_NS
        world_T_root = rigid(np.eye(3), np.array([SPEED * 1e-9 * (stamp - START_NS), 0.0, 1.0]))
        world_T_segment = body.forward_kinematics(world_T_root, np.tile(np.eye(3), (len(body.tree_joints), 1, 1)))
        for camera, mount in body.mounts.items():
            yield LandmarkMatches(
                camera=camera,
                stamp_ns=stamp,
                previous_stamp_ns=stamp - FRAME_NS if frame else 0,
                track_ids=np.zeros(0, np.uint32),
                landmark_ids=np.zeros(0, np.uint32),
                pixels=np.zeros((0, 2), np.float32),
                points_world=np.zeros((0, 3), np.float32),
                world_T_camera=world_T_segment[body.segment_index[mount.segment]] @ mount.segment_T_camera,
                pose_covariance=np.eye(6) * 1e-6,
                current_R_previous=np.eye(3),
                rotation_inliers=0,
            )


def test_what_waits_is_published_when_idle_and_at_the_end(graph: Any, tmp_path: Path) -> None:
    from bodycam_ros.nodes.message_classes import node_messages

    make = node_messages()
    path = write_body(tmp_path / "body.yaml")
    body = read_body(path)
    delay = SmootherSettings().output_delay
    graph.listen({"/joint_states": "sensor_msgs/msg/JointState", "/odometry": "nav_msgs/msg/Odometry"})
    registrations = {
        camera: graph.publisher(f"/{camera}/landmarks", "bodycam_msgs/msg/LandmarkMatches") for camera in body.mounts
    }
    infos = {camera: graph.publisher(f"/{camera}/camera_info", "sensor_msgs/msg/CameraInfo") for camera in body.mounts}
    given = {"body": str(path), "idle_flush": 1.5}
    (solver,) = graph.start(NodeProcess("skeleton_solver", "skeleton_solver", given))
    everything = [*registrations.values(), *infos.values()]
    graph.until(lambda: all(each.get_subscription_count() for each in everything), _START_S, "the solver listens")

    def publish(frames: range) -> None:
        for matches in _registrations(body, frames):
            registrations[matches.camera].publish(landmarks_message(make, matches))

    # Registrations that come before the cameras are known wait for them.
    publish(range(10))
    for publisher in infos.values():
        info = make("sensor_msgs/msg/CameraInfo", width=64, height=48, distortion_model="equidistant")
        info.d, info.k = [0.0] * 4, [30.0, 0.0, 31.5, 0.0, 30.0, 23.5, 0.0, 0.0, 1.0]
        publisher.publish(info)
    graph.until(lambda: len(graph.heard["/joint_states"]) == 10, _SOON_S, "an idle solver publishes what waits")
    publish(range(10, 20))
    graph.until(lambda: len(graph.heard["/joint_states"]) >= 20 - delay, _SOON_S, "the solver goes on after a pause")
    assert solver.end() == 0, solver.printed
    graph.until(lambda: len(graph.heard["/odometry"]) == 20, _SOON_S, "the rest is published before the node goes")

    states = graph.messages("/joint_states")
    assert [stamp_ns(state.header.stamp) for state in states] == [START_NS + k * FRAME_NS for k in range(20)]
    angles = np.array([numbers(state.position, np.float64, len(state.name)) for state in states])
    assert np.abs(angles).max() < np.radians(0.1)
    along_x = [odometry.pose.pose.position.x for odometry in graph.messages("/odometry")]
    assert np.allclose(along_x, SPEED * 1e-9 * FRAME_NS * np.arange(20), atol=2e-3)
    assert "Traceback" not in solver.printed
