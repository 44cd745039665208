"""A person's namespace: what the nodes in it read and publish lies in it, and frames have its prefix."""

from pathlib import Path
from typing import Any

from helpers.tiny_bag import write_tiny_bag

from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording

_START_S, _SOON_S = 60.0, 60.0


def test_a_bag_is_played_into_the_players_namespace(graph: Any, tmp_path: Path) -> None:
    """Its tracker there hears it, and says so there; who is in no namespace hears nothing."""
    tracks, info = "bodycam_msgs/msg/FeatureTracks", "sensor_msgs/msg/CameraInfo"
    graph.listen({"/anna/left/tracks": tracks, "/left/tracks": tracks, "/anna/left/camera_info": info})
    graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
    bag, theirs = str(write_tiny_bag(tmp_path / "bag", 12)), {"frame_prefix": "anna/"}
    graph.run(
        GraphNode("tracker", "tracker_left", {"camera": "left"}),
        GraphNode("tracker", "tracker_left", {"camera": "left", **theirs}, "anna"),
        GraphNode("player", "player", {"bagfile": bag, "cameras": ["left"], "loop": True, **theirs}, "anna"),
    )
    graph.until(lambda: len(graph.heard["/anna/left/tracks"]) >= 12, _START_S, "all images are tracked")
    assert {message.header.frame_id for message in graph.messages("/anna/left/tracks")} == {"anna/left_optical_frame"}
    assert graph.messages("/anna/left/camera_info")[0].header.frame_id.startswith("anna/")
    assert not graph.heard["/left/tracks"]
    parts = ("anna/player", "anna/tracker_left: camera left", "tracker_left: camera left")
    graph.until(lambda: all(map(graph.all_diagnostics, parts)), _SOON_S, "all three report by their full names")
    image = "/left/image_raw/compressed"
    lacking = f"no image: no node publishes {image}; /anna{image} is published: start driver and graph in the same "

    def report() -> str:
        return str(graph.all_diagnostics(parts[-1])[-1]["text"])

    graph.until(lambda: report().startswith(lacking), _SOON_S, "it says where the images are")


def test_a_namespaced_recording_is_played_into_its_namespace(graph: Any, tmp_path: Path) -> None:
    """By the node's namespace, or into none by a prefix."""
    tiny, own = write_tiny_bag(tmp_path / "tiny", 12), tmp_path / "bag"
    with BagFile(tiny) as bag, write_recording(own) as writer:
        for topic, stamp_ns, message in bag.messages([*bag.topics]):
            writer.write(f"/anna{topic}", stamp_ns, message)
    image = "sensor_msgs/msg/CompressedImage"
    graph.listen({f"{prefix}/left/image_raw/compressed": image for prefix in ("", "/anna", "/anna/anna")})
    given = {"bagfile": str(own), "readers": 0, "loop": True}
    graph.run(GraphNode("player", "player", given, "anna"))
    graph.until(lambda: len(graph.heard["/anna/left/image_raw/compressed"]) >= 12, _SOON_S, "it is played")
    assert not graph.heard["/left/image_raw/compressed"]
    graph.run(GraphNode("player", "another_player", {**given, "prefix": "anna"}))
    graph.until(lambda: len(graph.heard["/left/image_raw/compressed"]) >= 12, _SOON_S, "it is played without")
    assert not graph.heard["/anna/anna/left/image_raw/compressed"]
