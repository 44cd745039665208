"""Nodes that find each other late, as on a busy machine: what was seen before is not lost."""

from pathlib import Path
from typing import Any

from bodycam_ros.nodes.graph import READERS_OF_LANDMARKS, NodeProcess, live_graph, player

CAMERA = "waist_front"
_START_S, _IMAGES = 60.0, 60


def _without_solver(sample: Path, **given: object) -> list[NodeProcess]:
    """Tracker, registration and a player that waits for these two, of one camera."""
    tracker, registration, _ = live_graph(sample / "map", sample / "body.yaml", (CAMERA,))
    assert registration.parameters["landmark_readers"] == READERS_OF_LANDMARKS
    playing = player(sample / "sample/bag", 10.0, (CAMERA,))
    return [
        tracker,
        NodeProcess("registration", "registration", {**registration.parameters, **given}),
        NodeProcess("player", "player", {**playing.parameters, "readers": 2, "settle": 0.0}),
    ]


def test_a_solver_that_is_found_after_the_bag_is_played_hears_all_of_it(graph: Any, sample: Path) -> None:
    *_, playing = graph.start(*_without_solver(sample, landmark_wait=_START_S))
    graph.until(lambda: playing.process.poll() is not None, _START_S, "the bag is played")
    topic = f"/{CAMERA}/landmarks"
    graph.listen({topic: "bodycam_msgs/msg/LandmarkMatches"})
    graph.until(lambda: len(graph.heard[topic]) == _IMAGES, _START_S, "the landmarks of all images")


def test_a_solver_that_never_comes_is_not_waited_for_long(graph: Any, sample: Path) -> None:
    topic = f"/{CAMERA}/pose"
    graph.listen({topic: "geometry_msgs/msg/PoseWithCovarianceStamped"})
    graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
    *nodes, playing = _without_solver(sample, landmark_wait=0.5)
    graph.start(*nodes)
    graph.until_known(_START_S)
    graph.start(playing)
    graph.until(lambda: len(graph.heard[topic]) == _IMAGES, _START_S, "the poses of all images")
