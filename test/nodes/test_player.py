"""The player: what it plays, whom it waits for, what it says about it, and how it ends."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from helpers.tiny_bag import FRAME_NS, START_NS, write_tiny_bag

from bodycam_ros.errors import RecordingError
from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.messages.factory import stamp_ns

IMAGE, INFO = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo"
_START_S, _SOON_S = 60.0, 60.0
_DIAGNOSTICS = {"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"}


def _player(bag: Path, **given: object) -> GraphNode:
    return GraphNode("player", "player", {"bagfile": str(bag), "settle": 0.5, **given})


def _stamps(messages: Sequence[Any]) -> list[int]:
    return [stamp_ns(message.header.stamp) for message in messages]


def test_only_the_cameras_asked_for_are_played_in_order_and_over_again(graph: Any, tmp_path: Path) -> None:
    frames = 12
    bag = write_tiny_bag(tmp_path / "bag", frames)
    images = {f"/{camera}/image_raw/compressed": IMAGE for camera in ("left", "right")}
    graph.listen({"/left/image_raw/compressed": IMAGE, "/left/camera_info": INFO} | _DIAGNOSTICS)
    # Nobody reads the other camera, and nobody has to.
    (player,) = graph.run(_player(bag, cameras=["left"], loop=True))
    heard = graph.heard["/left/image_raw/compressed"]
    graph.until(lambda: len(heard) > 2 * frames, _START_S, "the bag is played for the third time")
    once = [START_NS + number * FRAME_NS for number in range(frames)]
    assert _stamps(graph.messages("/left/image_raw/compressed"))[: 2 * frames] == once + once
    assert not any(graph.count_publishers(topic) for topic in images if "right" in topic)
    graph.until(lambda: graph.diagnostics("player"), _SOON_S, "it reports")
    assert player.end() == 0


def test_it_names_what_it_waits_for_and_gives_up(graph: Any, tmp_path: Path) -> None:
    bag = write_tiny_bag(tmp_path / "bag")
    graph.listen({"/left/image_raw/compressed": IMAGE, "/left/camera_info": INFO} | _DIAGNOSTICS)
    (player,) = graph.run(_player(bag, readers=2, reader_wait=2.0))
    graph.until(lambda: player.is_over, _START_S, "it gives up")
    assert isinstance(player.error, RecordingError) and not graph.heard["/left/image_raw/compressed"]
    report, error = graph.diagnostics("player"), str(player.error)
    assert (report["level"], report["text"]) == (1, "waiting for readers"), "it reports before it plays"
    for text in ("/left/camera_info (1 of 2 nodes)", "/right/image_raw/compressed (no node)"):
        assert text in error and text in report["readers lacking"]


def test_a_bag_of_sensors_without_any_of_the_cameras_is_refused(graph: Any, tmp_path: Path) -> None:
    bag = write_tiny_bag(tmp_path / "bag")
    (player,) = graph.run(_player(bag, imu=str(bag), cameras=["left"]))
    graph.until(lambda: player.is_over, _START_S, "it refuses")
    assert isinstance(player.error, RecordingError)
    assert "has no inertial sensor of the cameras; expected topics /left/imu" in str(player.error)


def test_it_publishes_the_time_of_the_recording(graph: Any, tmp_path: Path) -> None:
    frames = 24
    bag = write_tiny_bag(tmp_path / "bag", frames)
    graph.listen({"/left/image_raw/compressed": IMAGE, "/left/camera_info": INFO} | _DIAGNOSTICS)
    graph.listen({"/clock": "rosgraph_msgs/msg/Clock"})
    own = {"settle": 0.5, "clock": 50.0, "rate": 0.2, "cameras": ["left"]}
    follower = GraphNode("tracker", "tracker", {"camera": "right", "use_sim_time": True})
    player, _ = graph.run(_player(bag, **own), follower)
    images = graph.heard["/left/image_raw/compressed"]

    def clock() -> list[int]:
        return [message.clock.sec * 1_000_000_000 + message.clock.nanosec for message in graph.messages("/clock")]

    def follows() -> bool:
        reports = [m for m in graph.messages("/diagnostics", -5) if m.status[0].name.startswith("tracker")]
        return bool(reports) and START_NS <= stamp_ns(reports[-1].header.stamp) <= START_NS + frames * FRAME_NS

    graph.until(lambda: len(images) > 5, _START_S, "images are played")
    assert clock()[0] == START_NS - 1, "the clock stands until the first image"
    assert clock()[-1] >= START_NS + 4 * FRAME_NS
    graph.until(follows, _SOON_S, "what follows the clock stamps its reports by it")
    graph.until(lambda: player.is_over, _SOON_S, "it plays the rest")
    assert player.end() == 0
    graph.until(lambda: len(images) >= frames, _SOON_S, "all is heard")
    assert _stamps(graph.messages("/left/image_raw/compressed")) == [START_NS + k * FRAME_NS for k in range(frames)]
    assert sorted(clock()) == clock(), "it never goes back"
