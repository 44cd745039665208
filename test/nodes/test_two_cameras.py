"""The graph over a small bag with faults in it: what arrives, what is left out, and what is said about it."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from helpers.live_graph import live_graph, player
from helpers.tiny_bag import CAMERAS, FRAME_NS, HEIGHT, START_NS, WIDTH, write_camera_info, write_jpeg, write_tiny_bag
from helpers.two_cameras import write_body, write_map

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.messages.factory import header_message, stamp_ns
from bodycam_ros.recording.bag_writer import RecordingWriter
from bodycam_ros.recording.typestore import recorded_messages

FRAMES = 24
_START_S, _SOON_S = 60.0, 60.0
_ERROR = 2
_DIAGNOSTICS = {"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"}


def _landmarks(*cameras: str) -> dict[str, str]:
    return {f"/{camera}/landmarks": "bodycam_msgs/msg/LandmarkMatches" for camera in cameras}


def _add_faults(writer: RecordingWriter) -> None:
    """Two images that are none, one of a wrong size and two of the past on ``left``; a camera of an unknown kind."""
    end_ns = START_NS + FRAMES * FRAME_NS
    make = recorded_messages()
    large = cv2.imencode(".jpg", np.zeros((2 * HEIGHT, WIDTH), np.uint8))[1].reshape(-1)
    contents = [np.frombuffer(b"no image", np.uint8), np.zeros(0, np.uint8), large]
    for number, content in enumerate(contents):
        header = header_message(make, end_ns + number, "left_optical_frame")
        image = make("sensor_msgs/msg/CompressedImage", header=header, format="jpeg", data=content)
        writer.write("/left/image_raw/compressed", end_ns + number, image)
    for number in range(2):
        write_jpeg(writer, "left", end_ns + 10 + number, START_NS + number, 50)
    write_camera_info(writer, "odd", START_NS, distortion_model="mystery")
    # The last words, so late that a report of their own speaks of them.
    for camera in CAMERAS:
        write_jpeg(writer, camera, end_ns + 3_000_000_000, end_ns + 3_000_000_000, 90)


def test_faulty_input_is_left_out_and_told(graph: Any, tmp_path: Path) -> None:
    body = write_body(tmp_path / "body.yaml", "odd")
    bag = write_tiny_bag(tmp_path / "bag", FRAMES, alter=_add_faults)
    graph.listen(_landmarks(*CAMERAS) | _DIAGNOSTICS)
    nodes = graph.run(*live_graph(write_map(tmp_path / "map"), body))
    # The player waits for its own readers; whoever else is slow to find the others would miss the start.
    graph.until(
        lambda: all(graph.count_publishers(f"/{c}/landmarks") for c in CAMERAS), _START_S, "the cameras are heard"
    )
    started = {each.node.name: each for each in [*nodes, *graph.run(player(bag, rate=2.0))]}

    graph.until(lambda: started["player"].is_over, _START_S, "the bag is played")
    for camera in CAMERAS:
        graph.until(lambda c=camera: len(graph.heard[f"/{c}/landmarks"]) >= FRAMES + 1, _SOON_S, "all images arrive")
        stamps = [stamp_ns(message.header.stamp) for message in graph.messages(f"/{camera}/landmarks")]
        assert stamps[:-1] == [START_NS + k * FRAME_NS for k in range(FRAMES)], "nothing is lost, not even at the start"

    left, right = (
        lambda camera=camera: graph.all_diagnostics(f"tracker_{camera}: camera {camera}") for camera in CAMERAS
    )
    covered = "nothing that can be tracked"
    are_grey = lambda: any(covered in report["text"] and report["level"] == _ERROR for report in right())  # noqa: E731
    graph.until(are_grey, _SOON_S, "grey images are reported")
    graph.until(lambda: left()[-1].get("images out of time") == "2", _SOON_S, "the images of the past are reported")
    assert left()[-1]["images unusable"] == "3" and left()[-1]["last error"] != "none"
    graph.until(lambda: "no image" in left()[-1]["text"], _SOON_S, "the end of the bag is told")
    assert left()[-1]["level"] == _ERROR
    of_left = graph.all_diagnostics("registration: camera left")
    assert _ERROR in {report["level"] for report in of_left}, "grey images cannot be registered"
    assert graph.diagnostics("registration: all cameras")["cameras rejected"] == "odd"

    graph.listen({"/map/points": "sensor_msgs/msg/PointCloud2", "/robot_description": "std_msgs/msg/String"})
    graph.until(lambda: graph.heard["/map/points"] and graph.heard["/robot_description"], _SOON_S, "latched topics")
    assert graph.messages("/map/points")[0].width == 30
    assert graph.messages("/robot_description")[0].data == urdf_text(read_body(body))

    assert "mystery" in graph.diagnostics("tracker_odd: camera odd")["text"]
    assert graph.end() == dict.fromkeys(started, 0), graph.report()
