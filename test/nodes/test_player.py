"""The player: what it plays, whom it waits for, what it says about it, and how it ends."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tiny_bag import FRAME_NS, START_NS, write_tiny_bag

from bodycam_ros.errors import RecordingError
from bodycam_ros.live.graph import GraphNode
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
    for text in ("/left/camera_info (1 of 2 nodes)", "/right/image_raw/compressed (nobody)"):
        assert text in error and text in report["readers lacking"]


def test_it_pauses_steps_and_says_what_time_it_is(graph: Any, tmp_path: Path) -> None:
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter
    from std_srvs.srv import Trigger

    frames = 24
    bag = write_tiny_bag(tmp_path / "bag", frames)
    graph.listen({"/left/image_raw/compressed": IMAGE, "/clock": "rosgraph_msgs/msg/Clock"} | _DIAGNOSTICS)
    own = {"readers": 0, "settle": 0.0, "clock": 50.0, "start_paused": True, "use_sim_time": True}
    follower = GraphNode("tracker", "tracker", {"camera": "right", "use_sim_time": True})
    player, _ = graph.run(_player(bag, **own), follower)
    images = graph.heard["/left/image_raw/compressed"]

    def clock() -> list[int]:
        return [message.clock.sec * 1_000_000_000 + message.clock.nanosec for message in graph.messages("/clock")]

    def set_rate(rate: float) -> Any:
        fresh = [Parameter("rate", value=rate).to_parameter_msg()]
        return graph.call("/player/set_parameters", SetParameters, parameters=fresh).results[0]

    def asked(service: str) -> tuple[bool, str]:
        answer = graph.call(f"/player/{service}", Trigger)
        return answer.success, answer.message

    graph.until(lambda: len(graph.heard["/clock"]) > 5, _START_S, "the clock speaks")
    assert set(clock()) == {START_NS - 1} and asked("is_paused") == (True, "paused") and not images
    # What was recorded at one time comes at once, and nothing else.
    for count in (1, 2):
        assert asked("play_next")[0]
        graph.until(lambda count=count: len(images) == count, _SOON_S, "one image")
        assert clock()[-1] <= START_NS + (count - 1) * FRAME_NS
    assert "out of range" in set_rate(0.0).reason and set_rate(0.2).successful
    assert asked("resume") == (True, "playing") and not asked("play_next")[0]
    graph.until(lambda: len(images) > 5, _SOON_S, "it goes on")
    assert asked("pause") == (True, "paused")
    paused, told = len(images), len(graph.heard["/clock"])
    graph.until(lambda: len(graph.heard["/clock"]) > told + 25, _SOON_S, "half a second passes")
    assert len(images) <= paused + 1 < frames and len(set(clock()[told + 5 :])) == 1, "time stands still"
    standing_ns = clock()[-1]
    graph.until(lambda: graph.diagnostics("player").get("text") == "paused", _SOON_S, "it says so")

    def follows() -> bool:
        reports = [m for m in graph.messages("/diagnostics", -5) if m.status[0].name.startswith("tracker")]
        return bool(reports) and stamp_ns(reports[-1].header.stamp) == standing_ns

    graph.until(follows, _SOON_S, "what follows the clock stamps its reports by it")
    assert set_rate(1000.0).successful and asked("toggle_paused") == (True, "playing")
    graph.until(lambda: player.is_over, _SOON_S, "it plays the rest")
    assert player.end() == 0
    graph.until(lambda: len(images) >= frames, _SOON_S, "all is heard")
    assert _stamps(graph.messages("/left/image_raw/compressed")) == [START_NS + k * FRAME_NS for k in range(frames)]
    assert sorted(clock()) == clock(), "it never goes back"
