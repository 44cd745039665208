"""Nodes of one graph with different maps: what is refused, with both names, and when it is over."""

from pathlib import Path
from typing import Any

from helpers.live_graph import live_graph
from helpers.tiny_bag import CAMERAS, write_tiny_bag
from helpers.two_cameras import write_body, write_map

from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.registration.map_identity import map_identity
from bodycam_ros.registration.reference_map import load_map

_SOON_S, _ERROR = 60.0, 2


def test_tracks_of_another_map_are_refused_with_both_names(graph: Any, tmp_path: Path) -> None:
    body, bag = write_body(tmp_path / "body.yaml"), write_tiny_bag(tmp_path / "bag", 24)
    hall, cellar = write_map(tmp_path / "hall"), write_map(tmp_path / "cellar", seed=6)
    names = {str(map_identity(load_map(path))) for path in (hall, cellar)}
    graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
    topic = f"/{CAMERAS[0]}/landmarks"
    graph.listen({topic: "bodycam_msgs/msg/LandmarkMatches"})
    *trackers, registration, solver = live_graph(hall, body)
    other = GraphNode(registration.executable, registration.name, {**registration.parameters, "map": str(cellar)})
    tracking = graph.start(*trackers)
    graph.run(solver)
    # Last, as trackers that are ready send their tracks at once.
    (registering,) = graph.start(other)
    graph.run(GraphNode("player", "player", {"bagfile": str(bag), "rate": 1.0, "loop": True, "readers": 3}))

    def is_refused(part: str) -> bool:
        return any(
            report["level"] == _ERROR and all(name in str(report) for name in names)
            for report in graph.all_diagnostics(part)
        )

    for part in ("registration: all cameras", f"tracker_left: camera {CAMERAS[0]}"):
        graph.until(lambda p=part: is_refused(p), _SOON_S, f"{part} names both maps")
    graph.until(
        lambda: any(
            report["level"] == _ERROR and report["text"].startswith("wrong") and CAMERAS[0] in report
            for report in graph.all_diagnostics("skeleton_solver: verdict")
        ),
        _SOON_S,
        "the verdict is wrong",
    )
    assert all(not message.registered for message in graph.messages(topic))
    # One line of the log for all cameras, by the registration alone.
    graph.until(lambda: "same map:=MAP" in registering.log, _SOON_S, "it is logged")
    (line,) = [line for line in registering.log.splitlines() if "same map:=MAP" in line]
    assert f"each of 2 cameras ({', '.join(sorted(CAMERAS))}): its tracker uses map" in line
    assert not any("same map:=MAP" in tracker.log for tracker in tracking)

    registering.end()
    heard = len(graph.heard[topic])
    graph.run(registration)
    graph.until(
        lambda: any(m.map_identity == m.tracks_map_identity != "" for m in graph.messages(topic, heard)),
        _SOON_S,
        "the right map is used",
    )
    graph.until(
        lambda: "wrong" not in graph.diagnostics("skeleton_solver: verdict")["text"], _SOON_S, "the verdict is over"
    )
    assert set(graph.end().values()) == {0}
