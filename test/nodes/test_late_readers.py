"""Nodes that find each other late, as on a busy machine: what was seen before is not lost."""

from pathlib import Path
from typing import Any

import pytest
from helpers.live_graph import live_graph, player

from bodycam_ros.graph.declared_graph import READERS_OF_LANDMARKS, GraphNode

CAMERA = "waist_front"
_START_S, _IMAGES = 60.0, 60


def _without_solver(sample: Path, **given: object) -> list[GraphNode]:
    """Tracker, registration and a player that waits for these two, of one camera."""
    tracker, registration, _ = live_graph(sample / "map", sample / "body.yaml", (CAMERA,))
    assert registration.parameters["landmark_readers"] == READERS_OF_LANDMARKS
    playing = player(sample / "sample/bag", 10.0, (CAMERA,))
    return [
        tracker,
        GraphNode("registration", "registration", {**registration.parameters, **given}),
        GraphNode("player", "player", {**playing.parameters, "readers": 2, "settle": 0.0}),
    ]


def _start(graph: Any, nodes: list[GraphNode]) -> None:
    graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
    graph.run(*nodes[:-1])
    graph.until_known(_START_S)
    graph.run(nodes[-1])


def _tracked(graph: Any) -> int:
    reports = graph.all_diagnostics(f"tracker_{CAMERA}: camera {CAMERA}")
    return sum(int(report["tracked per second"]) for report in reports)


def test_a_solver_that_is_found_after_the_bag_is_tracked_hears_all_of_it(graph: Any, sample: Path) -> None:
    _start(graph, _without_solver(sample, landmark_wait=_START_S))
    graph.until(lambda: _tracked(graph) == _IMAGES, _START_S, "all images are tracked")
    waits = f"waiting for more readers of the landmarks of {CAMERA}"
    graph.until(lambda: graph.diagnostics("registration: all cameras")["text"] == waits, _START_S, waits)
    topic = f"/{CAMERA}/landmarks"
    graph.listen({topic: "bodycam_msgs/msg/LandmarkMatches"})
    graph.until(lambda: len(graph.heard[topic]) == _IMAGES, _START_S, "the landmarks of all images")


def test_tracks_that_wait_for_a_solver_for_too_long_are_dropped_for_that_reason(
    graph: Any, sample: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bodycam_ros.nodes.registration.STAGE_DEPTH", _IMAGES // 2)
    _start(graph, _without_solver(sample, landmark_wait=_START_S))
    reason = f"camera {CAMERA}: tracks, but too few nodes read its landmarks"
    graph.until(lambda: graph.diagnostics("registration: all cameras").get("last error") == reason, _START_S, reason)
