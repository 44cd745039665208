"""The graph over a small bag with faults in it: what arrives, what is left out, and what is said about it."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from live_access import assert_as_listed
from tiny_bag import CAMERAS, FRAME_NS, HEIGHT, START_NS, WIDTH, write_camera_info, write_jpeg, write_tiny_bag
from two_cameras import write_body, write_map

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.messages.factory import numbers
from bodycam_ros.messages.header import header_message, stamp_ns
from bodycam_ros.nodes.graph import NodeProcess, live_graph, player
from bodycam_ros.recording.bag_writer import RecordingWriter
from bodycam_ros.recording.typestore import recorded_messages

FRAMES = 24
_START_S, _SOON_S = 60.0, 20.0
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
    # The last words, a second on, so that the next report speaks of all this.
    for camera in CAMERAS:
        write_jpeg(writer, camera, end_ns + 20, end_ns + 2_000_000_000, 90)


def test_faulty_input_is_left_out_and_told(graph: Any, tmp_path: Path) -> None:
    body = write_body(tmp_path / "body.yaml", "odd")
    bag = write_tiny_bag(tmp_path / "bag", FRAMES, alter=_add_faults)
    graph.listen(_landmarks(*CAMERAS) | _DIAGNOSTICS)
    nodes = graph.start(*live_graph(write_map(tmp_path / "map"), body))
    # The player waits for its own readers; whoever else is slow to find the others would miss the start.
    graph.until(lambda: all(graph.is_published(f"/{c}/landmarks") for c in CAMERAS), _START_S, "the cameras are heard")
    started = {each.node.name: each for each in [*nodes, *graph.start(player(bag, rate=2.0))]}

    graph.until(lambda: started["player"].process.poll() is not None, _START_S, "the bag is played")
    assert started["player"].process.returncode == 0, graph.report()
    for camera in CAMERAS:
        graph.until(lambda c=camera: len(graph.heard[f"/{c}/landmarks"]) >= FRAMES + 1, _SOON_S, "all images arrive")
        stamps = [stamp_ns(message.header.stamp) for message in graph.messages(f"/{camera}/landmarks")]
        assert stamps[:-1] == [START_NS + k * FRAME_NS for k in range(FRAMES)], "nothing is lost, not even at the start"

    left, right = (
        lambda camera=camera: graph.all_diagnostics(f"tracker_{camera}: camera {camera}") for camera in CAMERAS
    )
    graph.until(lambda: any("images out of time" in report for report in left()), _SOON_S, "the tracker reports")
    assert (left()[-1]["images skipped"], left()[-1]["images out of time"]) == ("3", "2")
    assert left()[-1]["last error"] != "none"
    covered = "nothing that can be tracked"
    assert any(covered in report["text"] and report["level"] == _ERROR for report in right()), "grey images"
    graph.until(lambda: "no image" in left()[-1]["text"], _SOON_S, "the end of the bag is told")
    assert left()[-1]["level"] == _ERROR
    assert_as_listed(graph, [each.node for each in nodes], ["tracker_left", "registration", "skeleton_solver"])
    of_left = graph.all_diagnostics("registration: camera left")
    assert _ERROR in {report["level"] for report in of_left}, "grey images cannot be registered"
    assert started["tracker_left"].printed.count("[WARN]") == 2, "once of each kind"
    assert "cannot be decoded" in started["tracker_left"].printed
    unknown = "distortion model 'mystery' is unknown"
    assert started["tracker_odd"].process.poll() == 1
    assert started["tracker_odd"].printed.startswith(f"tracker: error: camera 'odd': {unknown}")
    for name in ("registration", "skeleton_solver"):
        assert unknown in started[name].printed
    assert graph.diagnostics("registration: all cameras")["cameras refused"] == "odd"

    graph.listen({"/map/points": "sensor_msgs/msg/PointCloud2", "/robot_description": "std_msgs/msg/String"})
    graph.until(lambda: graph.heard["/map/points"] and graph.heard["/robot_description"], _SOON_S, "latched topics")
    assert graph.messages("/map/points")[0].width == 30
    assert graph.messages("/robot_description")[0].data == urdf_text(read_body(body))

    assert graph.end() == {name: int(name == "tracker_odd") for name in started}, graph.report()
    assert "Traceback" not in graph.report()


def test_images_wait_for_camera_info_and_for_a_reader(graph: Any) -> None:
    """A driver that offers raw images with best effort, and is there before anybody else."""
    from bodycam_ros.messages.factory import array_sequence
    from bodycam_ros.nodes.message_classes import node_messages
    from bodycam_ros.nodes.qos import best_effort, reliable

    make = node_messages()
    images = graph.publisher("/left/image_raw", "sensor_msgs/msg/Image", best_effort(100))
    infos = graph.publisher("/left/camera_info", "sensor_msgs/msg/CameraInfo", reliable(1))
    (tracker,) = graph.start(NodeProcess("tracker", "tracker_left", {"camera": "left", "transport": "raw"}))
    graph.until(lambda: "best effort" in tracker.printed, _START_S, "the tracker adapts to the driver")
    graph.until(images.get_subscription_count, _SOON_S, "the tracker reads")

    stamps = [START_NS + k * FRAME_NS for k in range(20)]
    for stamp in stamps:
        pixels = np.random.default_rng(stamp).integers(0, 255, WIDTH * HEIGHT, dtype=np.uint8)
        header = header_message(make, stamp, "left_optical_frame")
        image = make("sensor_msgs/msg/Image", header=header, width=WIDTH, height=HEIGHT, encoding="mono8", step=WIDTH)
        image.data = array_sequence(pixels)
        images.publish(image)
    info = make("sensor_msgs/msg/CameraInfo", width=WIDTH, height=HEIGHT, distortion_model="equidistant")
    info.d, info.k = [0.0] * 4, [30.0, 0.0, 31.5, 0.0, 30.0, 23.5, 0.0, 0.0, 1.0]
    infos.publish(info)
    graph.listen({"/left/tracks": "bodycam_msgs/msg/FeatureTracks"})
    graph.until(lambda: len(graph.heard["/left/tracks"]) == len(stamps), _SOON_S, "the images that waited are tracked")
    tracks = graph.messages("/left/tracks")
    assert [stamp_ns(message.header.stamp) for message in tracks] == stamps
    assert [stamp_ns(message.previous_stamp) for message in tracks] == [0, *stamps[:-1]]
    assert tracks[0].keyframe and len(numbers(tracks[0].track_ids, np.uint32, len(tracks[0].track_ids))) > 0
    assert tracker.end() == 0


def test_parameters_are_described_ranged_and_fixed(graph: Any) -> None:
    from rcl_interfaces.srv import DescribeParameters, SetParameters

    given = {"camera": "left", "tracker.keyframe_interval": 7, "tracker.max_track_age": 2}
    graph.start(NodeProcess("tracker", "tracker_left", given))
    names = ["camera", "tracker.keyframe_interval", "tracker.max_track_age", "smoother.window"]
    known = graph.call("/tracker_left/describe_parameters", DescribeParameters, names=names[:3]).descriptors
    assert [descriptor.name for descriptor in known] == names[:3]
    assert all(descriptor.description for descriptor in known)
    assert (known[1].integer_range[0].from_value, known[1].integer_range[0].to_value) == (1, 300)
    assert known[2].floating_point_range[0].to_value == pytest.approx(60.0)
    from rclpy.parameter import Parameter

    changed = [Parameter("tracker.keyframe_interval", value=9).to_parameter_msg()]
    (result,) = graph.call("/tracker_left/set_parameters", SetParameters, parameters=changed).results
    assert not result.successful
