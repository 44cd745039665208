"""Parameters of nodes: which change while they run, which are refused and why, and that a dump of them loads back."""

import time
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import yaml
from helpers.driven_camera import DrivenCamera
from helpers.two_cameras import write_map

from bodycam_ros.cli.settings import all_groups
from bodycam_ros.graph.declared_graph import GraphNode
from bodycam_ros.graph.node_parameters import GROUPS
from bodycam_ros.pipeline.settings import PipelineSettings

_CONFIG = Path(__file__).parents[2] / "config"
_START_S = 60.0
_OWN = {"tracker": {"camera": "left"}, "skeleton_solver": {"body": "body.yaml"}, "player": {"bagfile": "bag"}}


@pytest.fixture
def make(graph: Any) -> Iterator[Callable[..., Any]]:
    """Makes a node in this process, not configured yet, of parameters and of a parameter file."""
    made = []

    def node(name: str, given: Mapping[str, object], file: Path | None = None) -> Any:
        arguments = GraphNode(name, name, given if name == "player" else {**given, "autostart": False}).arguments()
        made.append(import_module(f"bodycam_ros.nodes.{name}").make(["--ros-args", *_file(file), *arguments]))
        made[-1].bring_up()
        return made[-1]

    yield node
    for each in made:
        each.destroy_node()


def _file(path: Path | None) -> list[str]:
    return [] if path is None else ["--params-file", str(path)]


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

    given = {"camera": "left", "keypoints.max_keypoints": 200}
    graph.run(GraphNode("tracker", "tracker", given))
    cases: list[tuple[str, Any, str]] = [
        ("longest_wait", 2.0, ""),
        ("longest_wait", 2, "type"),
        ("most_ahead", 7, ""),
        ("most_ahead", 0, "most_ahead"),
        ("image_queue", 10, "image_queue"),
        ("moments", "times.csv", "moments"),
        ("keypoints.max_keypoints", 300, "keypoints.max_keypoints"),
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
    changed = {"longest_wait": 2.0, "most_ahead": 7, "image_queue": 60, "use_sim_time": True}
    assert (given | changed).items() <= values.items()
    assert set(graph.end().values()) == {0}, graph.report()
    again = make("tracker", {}, _dump(values, "tracker", tmp_path / "tracker.yaml"))
    again.trigger_configure()  # with the topics come the parameters of their quality of service
    assert _same(_values(again), values | {"autostart": False})


@pytest.mark.parametrize("name", ["tracker", "registration", "skeleton_solver", "retarget", "player"])
def test_what_is_in_config_and_then_dumped_loads_back(make: Callable[..., Any], tmp_path: Path, name: str) -> None:
    own = _OWN.get(name, {})
    node = make(name, own, _CONFIG / "all_settings.yaml")
    values = _values(node)
    assert own.items() <= values.items()
    if name == "skeleton_solver":
        assert node.parameters.settings == PipelineSettings()
    assert _same(_values(make(name, {}, _dump(values, name, tmp_path / f"{name}.yaml"))), values)


def test_all_groups_are_known_to_the_nodes() -> None:
    assert GROUPS == {*all_groups()}


def test_what_changes_is_used_and_what_is_fixed_changes_before_it_is_configured(
    graph: Any, make: Callable[..., Any], tmp_path: Path
) -> None:
    import rclpy

    from bodycam_ros.nodes.parameters import latched

    node = make("registration", {"map": str(write_map(tmp_path / "map")), "cameras": ["left"]})
    other = str(write_map(tmp_path / "other", landmarks=7))
    for name, value in (("map", other), ("registrar.min_inliers", 15), ("extension.capacity", 500)):
        assert not _set(node, name, value)
    assert "capacity" in _set(node, "extension.capacity", 5)
    assert "autostart" in _set(node, "autostart", True)
    assert node.trigger_configure() == node.trigger_activate()
    stage = node.stage
    assert len(stage.map.landmark_ids) == 7, "it has read what was set before"
    assert "map" in _set(node, "map", other)
    assert "extension.capacity" in _set(node, "extension.capacity", 600)
    camera = DrivenCamera(graph, "left", latched(), latched())
    camera.inform()
    deadline_s = time.monotonic() + _START_S
    while not stage.fronts:
        assert time.monotonic() < deadline_s, "the camera_info does not come"
        rclpy.spin_once(node, timeout_sec=0.05)
    (front,) = stage.fronts.values()
    assert front._registrar.settings.min_inliers == 15
    assert not _set(node, "registrar.min_inliers", 25)
    assert front._registrar.settings.min_inliers == 25
    refusal = _set(node, "registrar.min_inliers", 1)
    assert "min_inliers" in refusal
    assert (front._registrar.settings, front._registrar.settings.min_inliers) == (stage.settings.registrar, 25)
