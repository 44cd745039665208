"""The solver alone, fed with cameras whose names were exchanged: its diagnostics name them, and take it back."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from known_motion import BODY, KnownMotion, exchanged

from bodycam_ros.body.body_file import write_body
from bodycam_ros.messages.tracks import landmarks_message
from bodycam_ros.nodes.graph import NodeProcess

CAMERAS = ("torso_front", "upper_arm_left", "forearm_left", "upper_arm_right", "forearm_right")
VERDICT = "skeleton_solver: verdict"
_START_S, _SOON_S, _AHEAD = 60.0, 60.0, 10


@pytest.mark.long
def test_exchanged_cameras_are_named_in_diagnostics_and_right_ones_are_good(graph: Any, tmp_path: Path) -> None:
    from bodycam_ros.nodes.message_classes import node_messages

    make = node_messages()
    path = tmp_path / "body.yaml"
    write_body(replace(BODY, mounts={camera: BODY.mounts[camera] for camera in CAMERAS}), path)
    graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray", "/joint_states": "sensor_msgs/msg/JointState"})
    registrations = {
        camera: graph.publisher(f"/{camera}/landmarks", "bodycam_msgs/msg/LandmarkMatches") for camera in CAMERAS
    }
    infos = {camera: graph.publisher(f"/{camera}/camera_info", "sensor_msgs/msg/CameraInfo") for camera in CAMERAS}
    graph.run(NodeProcess("skeleton_solver", "skeleton_solver", {"body": str(path), "verdict.interval": 1.0}))
    everything = [*registrations.values(), *infos.values()]
    graph.until(lambda: all(each.get_subscription_count() for each in everything), _START_S, "the solver listens")
    for publisher in infos.values():
        info = make("sensor_msgs/msg/CameraInfo", width=640, height=480, distortion_model="equidistant")
        info.d, info.k = [0.0] * 4, [240.0, 0.0, 319.5, 0.0, 240.0, 239.5, 0.0, 0.0, 1.0]
        publisher.publish(info)

    def publish(motion: KnownMotion) -> None:
        solved = len(graph.heard["/joint_states"])
        for number, matches in enumerate(motion.registrations()):
            registrations[matches.camera].publish(landmarks_message(make, matches))
            # No faster than it solves, or its queue would overflow.
            due = solved + number // len(CAMERAS) - _AHEAD
            graph.until(lambda due=due: len(graph.heard["/joint_states"]) >= due, _SOON_S, "it solves")

    publish(KnownMotion(CAMERAS, exchanged(("forearm_left", "forearm_right"))))
    graph.until(lambda: graph.diagnostics(VERDICT).get("text", "").startswith("wrong:"), _SOON_S, "it is wrong")
    told = graph.diagnostics(VERDICT)
    assert "its name is exchanged with forearm_right" in told["forearm_left"]
    assert "its name is exchanged with forearm_left" in told["forearm_right"]
    publish(KnownMotion(CAMERAS, starts_s=-100.0))
    graph.until(lambda: graph.diagnostics(VERDICT).get("text", "").startswith("good:"), _SOON_S, "it is good again")
