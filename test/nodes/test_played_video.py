"""A bag of videos, live: where ROS knows no CompressedVideo the player decodes, and the tracker reads what is there."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_video import HEIGHT, WIDTH, make_video, write_lens

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.cli.main import main
from bodycam_ros.live.graph import GraphNode
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.messages.images import COMPRESSED_VIDEO
from bodycam_ros.nodes.parameters import is_installed
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.typestore import recording_typestore

pytestmark = pytest.mark.skipif(is_installed(COMPRESSED_VIDEO), reason="foxglove_msgs is there: nothing is decoded")

_START_S = 60.0


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two cameras' videos of forty frames."""
    videos, place = tmp_path_factory.mktemp("videos"), tmp_path_factory.mktemp("place") / "bag"
    for camera in ("left", "right"):
        make_video(videos / f"{camera}.mp4", created="2024-05-01T12:00:00Z")
        write_lens(videos / f"{camera}.yaml")
    assert main(["ingest", str(videos), "-o", str(place)]) == 0
    return place


def test_frames_are_played_as_a_replay_decodes_them(bag: Path) -> None:
    from bodycam_ros.live.played_video import PlayedVideo

    with open_recording(bag) as recording:
        expected = {image.stamp_ns: decode_grey(image) for image in recording.images(["left"])}
    refused: list[str] = []
    with BagFile(bag) as file:
        video = PlayedVideo(file.topics, refused.append)
        assert video.played["/left/image_raw"] == "sensor_msgs/msg/Image"
        assert COMPRESSED_VIDEO not in video.played.values()
        for _ in range(2):  # a bag may be played again
            video.restart()
            messages = file.messages(video.sources)
            played = [pair for topic, _, message in messages for pair in video.serialized(topic, message)]
            played += video.rest()
            images = [cdr for topic, cdr in played if topic == "/left/image_raw"]
            assert len(images) == len(expected) and not refused
            for cdr in images:
                image = recording_typestore().deserialize_cdr(cdr, "sensor_msgs/msg/Image")
                assert (image.width, image.height, image.encoding) == (WIDTH, HEIGHT, "mono8")
                np.testing.assert_array_equal(image.data.reshape(HEIGHT, WIDTH), expected[stamp_ns(image.header.stamp)])
    assert {topic for topic, _ in played} >= {"/left/timing", "/right/camera_info"}


def test_the_tracker_reads_what_the_player_makes_of_a_video(graph: Any, bag: Path) -> None:
    graph.listen({"/left/timing": "bodycam_msgs/msg/CameraTiming", "/left/tracks": "bodycam_msgs/msg/FeatureTracks"})
    graph.run(
        GraphNode("tracker", "tracker_left", {"camera": "left"}),
        GraphNode("player", "player", {"bagfile": str(bag), "cameras": ["left"]}),
    )
    graph.until(lambda: len(graph.heard["/left/tracks"]) > 10, _START_S, "frames are tracked")
    graph.until(lambda: graph.heard["/left/timing"], _START_S, "the timing is heard")
