"""How long rows are read out, live: from the body by the solver, or from the camera itself, to the registration."""

from pathlib import Path
from typing import Any

import numpy as np
from helpers.two_cameras import BODY, write_map

from bodycam_ros.camera.readout import Readout
from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.messages.timing import timing_message
from bodycam_ros.messages.tracks import landmark_matches, tracks_message
from bodycam_ros.tracking.track_frame import TrackFrame

_START_S, _SOON_S = 60.0, 60.0
KNOWN_S = {"left": (0.012, 0.0002), "right": (0.020, 0.0)}
STARTS_S = KNOWN_S | {"left": (0.012, 0.0054)}  # another recording may be in another mode


def test_body_and_camera_tell_the_registration(graph: Any, tmp_path: Path) -> None:
    from bodycam_ros.nodes.parameters import latched, node_messages

    make = node_messages()
    body = tmp_path / "body.yaml"
    seconds, sigma = KNOWN_S["left"]
    body.write_text(BODY.replace("0.5]}", f"0.5], readout_time: {seconds}, readout_sigma: {sigma}}}"))
    kinds = {"camera_info": "sensor_msgs/msg/CameraInfo", "tracks": "bodycam_msgs/msg/FeatureTracks"}
    said = {(c, topic): graph.publisher(f"/{c}/{topic}", kind) for c in KNOWN_S for topic, kind in kinds.items()}
    # The right camera says more exactly than the body how its rows are read out.
    of_right = graph.publisher("/right/timing", "bodycam_msgs/msg/CameraTiming", latched())
    of_right.publish(timing_message(make, "right", "given", Readout(*KNOWN_S["right"])))
    graph.listen({f"/{c}/landmarks": "bodycam_msgs/msg/LandmarkMatches" for c in KNOWN_S})
    graph.run(
        GraphNode("skeleton_solver", "skeleton_solver", {"body": str(body)}),
        GraphNode("registration", "registration", {"map": str(write_map(tmp_path / "map")), "body": str(body)}),
    )
    graph.until(
        lambda: (
            all(each.get_subscription_count() for each in said.values())
            and all(graph.count_publishers(f"/{c}/timing") >= (2 if c == "right" else 1) for c in KNOWN_S)
        ),
        _START_S,
        "both nodes are there",
    )
    heard: dict[str, Readout | None] = {}
    number = 0

    def told() -> bool:
        nonlocal number
        number += 1
        for camera in KNOWN_S:
            info = make("sensor_msgs/msg/CameraInfo", width=64, height=48, distortion_model="equidistant")
            info.d, info.k = [0.0] * 4, [30.0, 0.0, 31.5, 0.0, 30.0, 23.5, 0.0, 0.0, 1.0]
            said[camera, "camera_info"].publish(info)
            said[camera, "tracks"].publish(tracks_message(make, _nothing_seen(camera, number)))
            for message in graph.messages(f"/{camera}/landmarks")[-1:]:
                matches = landmark_matches(message, camera)
                heard[camera] = matches.readout
        return {c: each and (each.seconds, round(each.sigma, 6)) for c, each in heard.items()} == STARTS_S

    graph.until(told, _SOON_S, "the registration knows how long the rows of both are read out")


def _nothing_seen(camera: str, number: int) -> TrackFrame:
    return TrackFrame(
        camera=camera,
        stamp_ns=number * 33_333_333,
        previous_stamp_ns=(number - 1) * 33_333_333,
        track_ids=np.zeros(0, np.uint32),
        pixels=np.zeros((0, 2), np.float32),
        keyframe=True,
        current_R_previous=np.eye(3),
        rotation_inliers=0,
    )
