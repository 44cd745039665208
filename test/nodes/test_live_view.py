"""The view of the running graph: what is published is what is seen."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.naming import naming
from numpy.testing import assert_allclose

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.errors import ViewError
from bodycam_ros.geometry import rigid, rotation_from_xyzw
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.results.colours import rgb
from bodycam_ros.viewer.live_session import LiveSession
from bodycam_ros.viewer.scene import LOST, REGISTERED, segment_name
from bodycam_ros.viewer.server import LocalServer

SECOND = 1_000_000_000


@pytest.fixture
def server() -> Iterator[LocalServer]:
    server = LocalServer(0, "test")
    yield server
    server.stop()


def test_the_scene_follows_what_the_graph_publishes(graph: Any, server: LocalServer, sample: Path) -> None:
    from bodycam_ros.messages.diagnostics import text_message
    from bodycam_ros.messages.factory import header_message
    from bodycam_ros.messages.poses import pose_with_covariance_message
    from bodycam_ros.nodes.body_listener import BodyListener
    from bodycam_ros.nodes.parameters import latched, message_class, node_messages

    body, make = read_body(sample / "body.yaml"), node_messages()
    names = JointAngles(body).names
    session = LiveSession(server, None)
    description = graph.publisher("/anna/robot_description", "std_msgs/msg/String", latched())
    description.publish(text_message(make, urdf_text(body)))
    joints = graph.publisher("/anna/joint_states", "sensor_msgs/msg/JointState")
    odometry = graph.publisher("/anna/odometry", "nav_msgs/msg/Odometry")
    camera = graph.publisher("/anna/head/pose", "geometry_msgs/msg/PoseWithCovarianceStamped")
    listener = BodyListener(session.put_body, session.put_state, namespace="anna")
    try:
        assert "waiting for /robot_description" in session.text

        def stepped(condition: Any) -> Any:
            def step() -> bool:
                session.step(0.02)
                return bool(condition())

            return step

        shin = segment_name("shin_left")
        graph.until(stepped(lambda: server.scene.get_handle_by_name(f"{shin}/surface")), 60.0, "the body")
        graph.until(lambda: camera.get_subscription_count() and joints.get_subscription_count(), 60.0, "a listener")
        graph.until(odometry.get_subscription_count, 60.0, "a listener")

        angles = np.zeros(len(names))
        angles[names.index("knee_left_y")] = 0.8
        world_T_root = rigid(np.eye(3), np.array([2.0, 1.0, 0.9]))
        covariance = np.eye(6) * 1e-6
        stamp = 10 * SECOND
        # Of another program: names without positions are allowed, and must not end what listens.
        nobodys = message_class("sensor_msgs/msg/JointState")(name=["wheel"])

        def publish() -> None:
            nonlocal stamp
            stamp += SECOND // 30
            joints.publish(nobodys)
            camera.publish(
                make(
                    "geometry_msgs/msg/PoseWithCovarianceStamped",
                    header=header_message(make, stamp, "map"),
                    pose=pose_with_covariance_message(make, np.eye(4), covariance),
                )
            )
            joints.publish(
                message_class("sensor_msgs/msg/JointState")(
                    header=header_message(make, stamp, "map"), name=list(names), position=angles.tolist()
                )
            )
            odometry.publish(
                message_class("nav_msgs/msg/Odometry")(
                    header=header_message(make, stamp, "map"),
                    child_frame_id=body.root,
                    pose=pose_with_covariance_message(make, world_T_root, covariance),
                )
            )

        def is_seen() -> bool:
            publish()
            session.step(0.05)
            frustum = server.scene.get_handle_by_name(f"{segment_name('head')}/camera_head")
            return frustum is not None and frustum.color == rgb(REGISTERED)  # type: ignore[attr-defined]

        graph.until(is_seen, 60.0, "the head's camera as registered")
        poses = body.forward_kinematics(world_T_root, JointAngles(body).poses(angles))
        expected = poses[body.segment_index["shin_left"]]
        handle = server.scene.get_handle_by_name(shin)
        assert handle is not None
        assert_allclose(handle.position, expected[:3, 3], atol=1e-5)
        assert_allclose(rotation_from_xyzw(np.roll(handle.wxyz, -1)), expected[:3, :3], atol=1e-5)
        world = server.scene.get_handle_by_name("/world")
        assert world is not None
        assert_allclose(world.position, [-2.0, -1.0, 0.0], atol=1e-6)  # followed
        other = server.scene.get_handle_by_name(f"{shin}/camera_shin_left")
        assert other is not None and other.color == rgb(LOST)  # type: ignore[attr-defined]
        graph.until(stepped(lambda: "states a second" in session.text), 60.0, "how many instants come")
    finally:
        listener.stop()


def test_a_namespace_that_is_none_is_refused() -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed; 'make test' installs it")
    from bodycam_ros.nodes.body_listener import BodyListener

    with naming(ViewError, "two words"):
        BodyListener(lambda text: None, lambda instant: None, "two words")
