"""Nodes that somebody else manages: they are brought up, held, cleaned up and shut down over their services."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from helpers.live_graph import live_graph
from helpers.two_cameras import write_map

from bodycam_ros.graph.declared_graph import GraphNode

CAMERA = "waist_front"
TRACKS, LANDMARKS = f"/{CAMERA}/tracks", f"/{CAMERA}/landmarks"
JOINTS = "/joint_states"
DESCRIPTION = "/robot_description"
POINTS = "/map/points"
_START_S, _SOON_S = 60.0, 60.0


class Managed:
    """Changes the state of nodes, as a lifecycle manager does."""

    def __init__(self, graph: Any) -> None:
        pytest.importorskip("lifecycle_msgs")
        from lifecycle_msgs.msg import Transition

        self._graph, self._transition = graph, Transition

    def change(self, node: str, label: str) -> bool:
        """Whether a transition succeeded."""
        from lifecycle_msgs.srv import ChangeState

        asked = self._transition(label=label)
        return bool(self._graph.call(f"/{node}/change_state", ChangeState, transition=asked).success)

    def state(self, node: str) -> str:
        from lifecycle_msgs.srv import GetState

        return str(self._graph.call(f"/{node}/get_state", GetState).current_state.label)


def managed(nodes: list[GraphNode]) -> list[GraphNode]:
    return [replace(node, parameters={**node.parameters, "autostart": False}) for node in nodes]


@pytest.mark.long
def test_a_graph_is_managed_from_its_start_to_its_end(graph: Any, sample: Path) -> None:
    from helpers.live_drivers import FRAME_NS, Drivers
    from std_srvs.srv import Trigger

    graph.listen({TRACKS: "bodycam_msgs/msg/FeatureTracks", LANDMARKS: "bodycam_msgs/msg/LandmarkMatches"})
    graph.listen({JOINTS: "sensor_msgs/msg/JointState", DESCRIPTION: "std_msgs/msg/String"})
    graph.listen({POINTS: "sensor_msgs/msg/PointCloud2", "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
    drivers = Drivers(graph, sample / "sample/bag", [CAMERA])
    manager = Managed(graph)
    tracker, registration, solver = names = (f"tracker_{CAMERA}", "registration", "skeleton_solver")
    started = {
        each.node.name: each for each in graph.run(*managed(live_graph(sample / "map", sample / "body.yaml", [CAMERA])))
    }

    def goes_on(topic: str, more: int = 3) -> None:
        before = len(graph.heard[topic])
        drivers.until(lambda: len(graph.heard[topic]) >= before + more, _SOON_S, f"{topic} goes on")

    def is_quiet(*topics: str) -> None:
        """What was on its way is received; then nothing is for some images."""
        counts, before = [-1], [0]
        for _ in range(20):
            before, counts = counts, [len(graph.heard[topic]) for topic in topics]
            if counts == before:
                return
            drive(5)
        raise AssertionError(f"{topics} go on: {before}, {counts}")

    def drive(images: int) -> None:
        last_ns = drivers.stamp_ns + images * FRAME_NS
        drivers.until(lambda: drivers.stamp_ns >= last_ns, _SOON_S, "images are published")

    def registered_again() -> None:
        drivers.until(lambda: graph.messages(LANDMARKS, -1)[0].registered, _SOON_S, "the camera is registered")

    def begins_anew(before: int) -> bool:
        """Whether one of the track messages since then follows none."""
        follows = (message.previous_stamp for message in graph.messages(TRACKS, before))
        return any(stamp.sec == stamp.nanosec == 0 for stamp in follows)

    graph.until_known(_START_S)
    for name in names:
        assert manager.state(name) == "unconfigured"
        assert not manager.change(name, "activate")  # not before it is configured
        assert graph.diagnostics(name)["text"] == "unconfigured"
    assert not any(map(graph.count_publishers, (TRACKS, LANDMARKS, JOINTS)))

    for name in names:
        assert manager.change(name, "configure"), graph.report()
        assert manager.state(name) == "inactive"
    graph.until(drivers.are_heard, _START_S, "all listen")
    drive(5)
    assert not any(graph.heard[topic] for topic in (TRACKS, LANDMARKS, JOINTS, DESCRIPTION, POINTS))
    graph.until(lambda: graph.diagnostics(tracker)["text"] == "inactive", _SOON_S, "the tracker reports its state")

    for name in names:
        assert manager.change(name, "activate")
    goes_on(JOINTS)
    registered_again()
    assert len(graph.heard[POINTS]) == 1 and graph.heard[DESCRIPTION]

    assert manager.change(solver, "deactivate")
    is_quiet(JOINTS)
    goes_on(LANDMARKS)
    assert manager.change(solver, "activate")
    goes_on(JOINTS)

    assert manager.change(registration, "deactivate")
    is_quiet(LANDMARKS, JOINTS)
    assert manager.change(registration, "activate")
    goes_on(JOINTS)
    registered_again()

    assert manager.change(tracker, "deactivate")
    is_quiet(TRACKS, LANDMARKS, JOINTS)
    assert manager.change(tracker, "activate")
    goes_on(JOINTS)

    tracked = len(graph.heard[TRACKS])
    assert graph.call(f"/{tracker}/reset", Trigger).success
    drivers.until(lambda: begins_anew(tracked), _SOON_S, "the tracks begin anew")
    for name in (registration, solver):
        assert graph.call(f"/{name}/reset", Trigger).success
    goes_on(JOINTS)

    # What was not heard while nobody worked is nobody's loss.
    reports = [graph.diagnostics(f"{tracker}: camera {CAMERA}"), graph.diagnostics(f"{registration}: all cameras")]
    assert not {"images dropped", "track messages lost", "images unusable"} & {key for each in reports for key in each}

    for label in ("deactivate", "cleanup"):
        assert manager.change(registration, label)
    graph.until(lambda: not graph.count_publishers(LANDMARKS), _SOON_S, "the publishers are gone")
    assert manager.change(registration, "configure") and manager.change(registration, "activate")
    registered = len(graph.heard[LANDMARKS])
    drivers.until(lambda: len(graph.heard[LANDMARKS]) > registered, _SOON_S, "the registration works again")
    registered_again()

    assert manager.change(tracker, "shutdown")
    assert manager.state(tracker) == "finalized" and not started[tracker].is_over
    assert set(graph.end().values()) == {0}


def test_what_goes_wrong_is_said_and_mended(graph: Any, tmp_path: Path) -> None:
    """A configuration by hand that fails leaves a node unconfigured, whether or not it starts itself."""
    graph.listen({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
    manager = Managed(graph)
    here, away = tmp_path / "map", tmp_path / "away"
    write_map(here)
    given = {"map": str(here), "cameras": ["left"]}
    (managed_node,) = managed([GraphNode("registration", "managed", given)])
    graph.run(managed_node)
    (own,) = graph.run(GraphNode("registration", "own", given))
    graph.until_known(_START_S)
    assert manager.state("own") == "active"
    assert manager.change("own", "deactivate") and manager.change("own", "cleanup")
    here.rename(away)
    for name in ("managed", "own"):
        assert not manager.change(name, "configure")
        assert manager.state(name) == "unconfigured"

    def explains(name: str) -> bool:
        report = graph.diagnostics(name)
        text = report.get("text", "")
        return "unconfigured: " in text and "there is no map folder" in text and report["level"] == 2

    for name in ("managed", "own"):
        graph.until(lambda name=name: explains(name), _SOON_S, "it says why")
    assert not own.is_over
    away.rename(here)
    for name in ("managed", "own"):
        assert manager.change(name, "configure") and manager.change(name, "activate"), graph.report()
    assert set(graph.end().values()) == {0}
