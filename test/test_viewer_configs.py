"""RViz's and Foxglove's configurations: what they name is published as they need it, in OUT and by the live graph."""

import importlib.util
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import is_latched

CONFIG = Path(__file__).parent.parent / "config"

SHOWN_BY_RVIZ = {
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "Odometry": "nav_msgs/msg/Odometry",
    "PointCloud2": "sensor_msgs/msg/PointCloud2",
    "RobotModel": "std_msgs/msg/String",
}
"""Display of rviz_default_plugins -> message that it subscribes to."""

SHOWN_BY_FOXGLOVE = {
    "3D": {*SHOWN_BY_RVIZ.values(), "tf2_msgs/msg/TFMessage"},
    "DiagnosticSummary": {"diagnostic_msgs/msg/DiagnosticArray"},
}


@pytest.fixture(scope="module")
def rviz() -> Any:
    return yaml.safe_load((CONFIG / "bodycam.rviz").read_text())["Visualization Manager"]


@pytest.fixture(scope="module")
def foxglove() -> Any:
    return json.loads((CONFIG / "bodycam.foxglove.json").read_text())


@pytest.fixture(scope="module")
def published(sample_out: Path) -> dict[str, str]:
    with BagFile(sample_out) as bag:
        return bag.topics


@pytest.fixture(scope="module")
def frames(sample_out: Path) -> set[str]:
    with BagFile(sample_out) as bag:
        pairs = [
            {transform.header.frame_id, transform.child_frame_id}
            for _, _, message in bag.messages(["/tf"])
            for transform in message.transforms
        ]
    return set().union(*pairs)


def rviz_topics(rviz: Any) -> Iterator[tuple[str, str, str]]:
    """Display, topic and durability."""
    for display in rviz["Displays"]:
        kind = display["Class"].removeprefix("rviz_default_plugins/")
        if topic := display.get("Topic") or display.get("Description Topic"):
            yield kind, topic["Value"], topic["Durability Policy"]
        else:
            assert kind in ("Grid", "TF")


def foxglove_topics(foxglove: Any) -> Iterator[tuple[str, str]]:
    """Panel and the message path or topic that it shows."""
    for panel, config in foxglove["configById"].items():
        kind = panel.partition("!")[0]
        given = [config.get("topicPath"), config.get("topicToRender")]
        paths = [path["value"] for path in config.get("paths", [])]
        yield from ((kind, topic) for topic in (*config.get("topics", {}), *filter(None, given), *paths))


def test_rviz_shows_topics_of_a_solved_bag_with_their_types(
    rviz: Any, published: dict[str, str], frames: set[str]
) -> None:
    shown = list(rviz_topics(rviz))
    assert {kind for kind, _, _ in shown} == set(SHOWN_BY_RVIZ)
    for kind, topic, durability in shown:
        assert published[topic] == SHOWN_BY_RVIZ[kind]
        # Who asks for latched messages where none are offered hears nothing; who does not comes too late for the map.
        assert (durability == "Transient Local") == is_latched(topic)
    assert {rviz["Global Options"]["Fixed Frame"], rviz["Views"]["Current"]["Target Frame"]} <= frames


def test_foxglove_shows_topics_of_a_solved_bag_with_their_types(
    foxglove: Any, published: dict[str, str], frames: set[str], sample_out: Path
) -> None:
    for kind, path in foxglove_topics(foxglove):
        topic, *fields = path.split(".")
        assert topic in published
        assert published[topic] in SHOWN_BY_FOXGLOVE.get(kind, {published[topic]})
        with BagFile(sample_out) as bag:
            value: Any = next(message for _, _, message in bag.messages([topic]))
        for field in fields:
            value = getattr(value, field)
        assert kind != "Plot" or isinstance(value, float)
    scene = foxglove["configById"]["3D!body"]
    assert {scene["followTf"], *(layer["frameId"] for layer in scene["layers"].values())} <= frames


def test_foxglove_lays_out_every_panel_once(foxglove: Any) -> None:
    def panels(node: Any) -> Iterator[str]:
        if isinstance(node, str):
            yield node
        else:
            assert 0 < node["splitPercentage"] < 100 and node["direction"] in ("row", "column")
            yield from panels(node["first"])
            yield from panels(node["second"])

    assert sorted(panels(foxglove["layout"])) == sorted(foxglove["configById"])


@pytest.mark.skipif(importlib.util.find_spec("rclpy") is None, reason="rclpy is not installed: make .venv/ros.stamp")
def test_the_live_graph_publishes_the_same(rviz: Any, foxglove: Any, published: dict[str, str]) -> None:
    from bodycam_ros.nodes.body_topics import OUTPUTS

    by_others = {"/robot_description", "/map/points", "/diagnostics"}  # of the solver, the registration, all
    for topic in {topic for _, topic, _ in rviz_topics(rviz)} | {p.split(".")[0] for _, p in foxglove_topics(foxglove)}:
        assert topic in by_others or OUTPUTS[topic] == published[topic]
