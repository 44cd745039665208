"""A person's namespace: what the nodes in it read and publish lies in it, and frames have its prefix."""

from pathlib import Path
from typing import Any

from helpers.tiny_bag import write_tiny_bag

from bodycam_ros.graph.declared_graph import GraphNode

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
    lacking = "no image: no node publishes left/image_raw/compressed"
    assert {report["text"] for report in graph.all_diagnostics(parts[-1])} == {lacking}
