"""A bag of videos, live: the player plays their packets as they are, and the tracker decodes them."""

from pathlib import Path
from typing import Any

import pytest
from helpers.made_video import make_video, write_lens
from helpers.naming import naming

from bodycam_ros.cli.main import main
from bodycam_ros.errors import SettingsError
from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.messages.factory import stamp_ns
from bodycam_ros.recording.bag_reader import open_recording

_START_S = 60.0
_HELD_BACK = 3
"""Frames that a decoder may still have at the end."""


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two cameras' videos of forty frames."""
    videos, place = tmp_path_factory.mktemp("videos"), tmp_path_factory.mktemp("place") / "bag"
    for camera in ("left", "right"):
        make_video(videos / f"{camera}.mp4", created="2024-05-01T12:00:00Z")
        write_lens(videos / f"{camera}.yaml")
    assert main(["ingest", str(videos), "-o", str(place)]) == 0
    return place


def test_the_tracker_reads_a_video_that_is_played(graph: Any, bag: Path) -> None:
    with open_recording(bag) as recording:
        expected = [image.stamp_ns for image in recording.images(["left"])]
    graph.listen({"/left/timing": "bodycam_msgs/msg/CameraTiming", "/left/tracks": "bodycam_msgs/msg/FeatureTracks"})
    graph.run(
        GraphNode("tracker", "tracker_left", {"camera": "left"}),
        GraphNode("player", "player", {"bagfile": str(bag), "cameras": ["left"]}),
    )
    heard = graph.heard["/left/tracks"]
    graph.until(lambda: len(heard) >= len(expected) - _HELD_BACK, _START_S, "frames are tracked")
    stamps = [stamp_ns(message.header.stamp) for message in graph.messages("/left/tracks")]
    assert stamps == expected[: len(stamps)]
    graph.until(lambda: graph.heard["/left/timing"], _START_S, "the timing is heard")


def test_a_package_of_messages_that_is_missing_is_named() -> None:
    from bodycam_ros.nodes.parameters import message_class

    with naming(SettingsError, "ros-jazzy-absent-msgs"):
        message_class("absent_msgs/msg/Video")
