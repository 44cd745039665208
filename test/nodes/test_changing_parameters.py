"""Parameters of nodes: which change while they run, which are refused and why, and that a dump of them loads back."""

import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from driven_camera import DrivenCamera
from tiny_bag import FRAME_NS, START_NS
from two_cameras import write_body, write_map

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.nodes.graph import NodeProcess

_CONFIG = Path(__file__).parents[2] / "config"
_START_S = 60.0
_DEADLINE = "qos_overrides./left/image_raw/compressed.subscription.deadline"
_NODES = {
    "tracker": ("tracker", "Tracker"),
    "region_tracker": ("region_tracker", "RegionTracking"),
    "registration": ("registration", "Registration"),
    "skeleton_solver": ("skeleton_solver", "SkeletonSolver"),
    "retarget": ("retarget", "RetargetNode"),
    "humans": ("humans", "HumansNode"),
    "player": ("player", "Player"),
}


@pytest.fixture
def make(graph: Any) -> Iterator[Callable[..., Any]]:
    """Makes a node in this process, not configured yet, of parameters and of a parameter file."""
    from importlib import import_module

    import rclpy

    nodes: list[Any] = []

    def node(name: str, given: Mapping[str, object], file: Path | None = None) -> Any:
        module, of = _NODES[name]
        arguments = NodeProcess(name, name, given).arguments(file)
        nodes.append(getattr(import_module(f"bodycam_ros.nodes.{module}"), of)(arguments))
        return nodes[-1]

    rclpy.init()
    yield node
    for each in nodes:
        each.destroy_node()
    rclpy.shutdown()


def _dump(values: Mapping[str, Any], node: str, path: Path) -> Path:
    """What ``ros2 param dump`` writes: names split at their dots, under the node's full name."""
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *above, last = name.split(".")
        branch = tree
        for part in above:
            branch = branch.setdefault(part, {})
        branch[last] = value
    path.write_text(yaml.dump({f"/{node}": {"ros__parameters": tree}}, default_flow_style=False))
    return path


def _values(node: Any) -> dict[str, Any]:
    """All parameters of a node in this process."""
    names = node.list_parameters([], 0).names
    return {name: node.get_parameter(name).value for name in names}


def _asked(graph: Any, node: str) -> dict[str, Any]:
    """All parameters of a node, by its services."""
    from rcl_interfaces.srv import GetParameters, ListParameters
    from rclpy.parameter import parameter_value_to_python

    names = graph.call(f"/{node}/list_parameters", ListParameters).result.names
    values = graph.call(f"/{node}/get_parameters", GetParameters, names=names).values
    return dict(zip(names, map(parameter_value_to_python, values), strict=True))


def _set(node: Any, name: str, value: Any) -> str:
    """Set a parameter; why it was not set, or nothing."""
    from rclpy.parameter import Parameter

    result = node.set_parameters_atomically([Parameter(name, value=value)])
    assert result.successful == (not result.reason)
    return str(result.reason)


def _same(values: Mapping[str, Any], others: Mapping[str, Any]) -> bool:
    """Also where a value is no number."""
    return {name: repr(value) for name, value in values.items()} == {name: repr(v) for name, v in others.items()}


def test_a_running_tracker_changes_or_says_why_not_and_its_dump_loads_back(
    graph: Any, make: Callable[..., Any], tmp_path: Path
) -> None:
    from rcl_interfaces.msg import LoggerLevel
    from rcl_interfaces.srv import SetLoggerLevels, SetParameters
    from rclpy.parameter import Parameter

    given = {"camera": "left", _DEADLINE: 100_000_000, "keypoints.max_keypoints": 200}
    graph.run(NodeProcess("tracker", "tracker", given))
    cases: list[tuple[str, Any, str]] = [
        ("longest_wait", 2, ""),
        ("most_ahead", 7, ""),
        ("most_ahead", 0, "parameters: most_ahead = 0 is out of range; how far the tracker may run ahead"),
        ("recovery", "soon", "parameters: recovery must be float, not 'soon'"),
        ("image_queue", 10, "image_queue is fixed once the node is configured; restart it with -p image_queue:=VALUE"),
        ("moments", "times.csv", "moments is fixed when the node starts"),
        (_DEADLINE, 5, f"is fixed once the topic is there; restart the node with -p {_DEADLINE}:=5"),
        ("tracker.keyframe_interval", 5, "parameters: tracker: tracker.keyframe_interval is fixed"),
        ("use_sim_time", True, ""),
    ]
    fresh = [Parameter(name, value=value).to_parameter_msg() for name, value, _ in cases]
    results = graph.call("/tracker/set_parameters", SetParameters, parameters=fresh).results
    for (name, value, complaint), result in zip(cases, results, strict=True):
        assert (complaint in result.reason) if complaint else result.successful, f"{name} {value}: {result.reason}"
        assert result.successful == (not complaint)
    levels = [LoggerLevel(name="tracker", level=LoggerLevel.LOG_LEVEL_DEBUG)]
    answer = graph.call("/tracker/set_logger_levels", SetLoggerLevels, levels=levels)
    assert [each.successful for each in answer.results] == [True]

    values = _asked(graph, "tracker")
    changed = {"longest_wait": 2.0, "most_ahead": 7, "recovery": 5.0, "image_queue": 60, "use_sim_time": True}
    assert (given | changed).items() <= values.items()
    assert set(graph.end().values()) == {0}, graph.report()
    again = make("tracker", {}, _dump(values, "tracker", tmp_path / "tracker.yaml"))
    again.prepare()  # it reads the topics then, whose quality of service is in the dump, too
    assert _same(_values(again), values)


@pytest.mark.parametrize("file", ["all_settings.yaml", "bodycam.yaml"])
def test_what_is_in_config_and_then_dumped_loads_back(make: Callable[..., Any], tmp_path: Path, file: str) -> None:
    own = {"tracker": {"camera": "left"}, "skeleton_solver": {"body": "body.yaml"}, "player": {"bag": "bag"}}
    for name in _NODES:
        values = _values(make(name, own.get(name, {}), _CONFIG / file))
        assert own.get(name, {}).items() <= values.items()
        assert _same(_values(make(name, {}, _dump(values, name, tmp_path / f"{name}.yaml"))), values), name


def test_what_changes_is_used_and_what_is_fixed_changes_before_it_is_configured(
    graph: Any, make: Callable[..., Any], tmp_path: Path
) -> None:
    import rclpy

    from bodycam_ros.nodes.qos import latched

    node = make("registration", {"map": str(write_map(tmp_path / "map")), "cameras": ["left"]})
    other = str(write_map(tmp_path / "other", landmarks=7))
    for name, value in (("map", other), ("registrar.min_inliers", 15), ("growth.capacity", 500)):
        assert not _set(node, name, value)
    assert "capacity = 5 is out of range" in _set(node, "growth.capacity", 5)
    assert "is fixed when the node starts" in _set(node, "autostart", False)
    node.bring_up()
    assert len(node.map.landmark_ids) == 7, "it has read what was set before"
    assert "map is fixed once" in _set(node, "map", other)
    assert "growth.capacity is fixed once" in _set(node, "growth.capacity", 600)
    camera = DrivenCamera(graph, "left", latched(), latched())
    camera.inform()
    deadline_s = time.monotonic() + _START_S
    while not node._registrars:
        assert time.monotonic() < deadline_s, "the camera_info does not come"
        rclpy.spin_once(node, timeout_sec=0.05)
    (registrar,) = node._registrars.values()
    assert registrar.settings.min_inliers == 15
    assert not _set(node, "registrar.min_inliers", 25) and not _set(node, "doubt.reach", 1)
    assert (registrar.settings.min_inliers, registrar.doubt_settings.reach) == (25, 1.0)
    refusal = _set(node, "registrar.min_inliers", 1)
    assert refusal.startswith("parameters: registrar: min_inliers = 1 is out of range; fewer landmarks in agreement")
    assert (registrar.settings, registrar.settings.min_inliers) == (node.settings.registrar, 25)


def test_settings_of_a_robot_are_refused_for_they_are_read_at_the_start(make: Callable[..., Any]) -> None:
    node = make("retarget", {})
    assert "retarget.clearance is fixed when the node starts" in _set(node, "retarget.clearance", 0.05)


def test_another_id_of_a_human_counts_once_the_node_is_configured(make: Callable[..., Any]) -> None:
    node = make("humans", {"body_id": "anna"})
    assert not _set(node, "body_id", "berta")
    node.bring_up()
    assert node.resolve_topic_name(node._states.topic) == "/humans/bodies/berta/joint_states"


def test_the_dump_of_a_human_loads_back_and_does_not_outlive_the_body(
    make: Callable[..., Any], sample: Path, tmp_path: Path
) -> None:
    from std_msgs.msg import String

    text = urdf_text(read_body(sample / "body.yaml"))
    node = make("humans", {"body_id": "anna"})
    node.bring_up()
    node._on_body(String(data=text))
    values = _values(node)
    assert "_anna" in values["human_description_anna"]
    dumped = values | {"human_description_anna": "of another body"}
    again = make("humans", {}, _dump(dumped, "humans", tmp_path / "humans.yaml"))
    again.bring_up()
    again._on_body(String(data=text))
    assert _same(_values(again), values)


def test_markers_are_as_frequent_as_is_wished(make: Callable[..., Any], tmp_path: Path) -> None:
    node = make("skeleton_solver", {"body": str(write_body(tmp_path / "body.yaml")), "marker_rate": 15.0})
    node.bring_up()

    def due(first: int, count: int) -> list[bool]:
        return [node._topics._are_markers_due(START_NS + (first + k) * FRAME_NS) for k in range(count)]

    assert due(0, 6) == [True, False, True, False, True, False]
    assert not _set(node, "marker_rate", 1000) and all(due(6, 6))
    assert not _set(node, "marker_rate", 0.0) and not any(due(12, 6))
    assert not _set(node, "marker_rate", 10.0) and due(0, 4) == [True, False, False, True], "time went back"
