"""How topics are read and published where a user says so, and what the middleware tells of them."""

from collections.abc import Iterator
from typing import Any

import pytest
from driven_camera import DrivenCamera, stamps

from bodycam_ros.errors import SettingsError
from bodycam_ros.nodes.graph import NodeProcess

pytestmark = pytest.mark.long

_START_S, _SOON_S = 60.0, 20.0
_DIAGNOSTICS = {"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"}
_MISSED, _SILENT = "deadlines missed, /left/image_raw", "publishers not alive, /left/image_raw"
_INCOMPATIBLE = "publishers incompatible, /right/image_raw"
_IMAGES = "qos_overrides./left/image_raw.subscription"


@pytest.fixture
def given(graph: Any) -> Iterator[Any]:
    """What a node makes of overrides that are given on its command line."""
    import rclpy
    from rclpy.node import Node

    from bodycam_ros.nodes.qos_overrides import given_overrides

    context = rclpy.Context()
    rclpy.init(context=context)
    nodes: list[Node] = []

    def of(parameters: dict[str, object]) -> tuple[Node, dict[str, Any]]:
        arguments = NodeProcess("", "overriding", parameters).arguments()
        nodes.append(
            Node(
                "overriding", context=context, cli_args=arguments, automatically_declare_parameters_from_overrides=True
            )
        )
        return nodes[-1], given_overrides(nodes[-1])

    yield of
    for node in nodes:
        node.destroy_node()
    rclpy.shutdown(context=context)


def test_what_cannot_be_overridden_is_refused_with_the_reason(given: Any) -> None:
    from std_msgs.msg import String

    from bodycam_ros.nodes import qos_overrides as of
    from bodycam_ros.nodes.qos import latched, reliable, sensor_data

    cases: list[tuple[Any, Any, str, dict[str, object], str]] = [
        (
            of.IMAGES_HEARD,
            sensor_data,
            "subscription",
            {"depth": 5},
            "may not be overridden, for the parameter 'image_q",
        ),
        (of.IMAGES_HEARD, sensor_data, "subscription", {"reliability": "lossy"}, "must be reliable or best_effort or"),
        (of.IMAGES_HEARD, sensor_data, "subscription", {"deadline": 0.5}, "whole number of nanoseconds, 0 or more"),
        (of.IMAGES_HEARD, sensor_data, "subscription", {"reliabilty": "reliable"}, "there is no policy 'reliabilty'"),
        (of.IMAGES_HEARD, sensor_data, "topic", {"depth": 5}, "expected qos_overrides./TOPIC.publisher.POLICY"),
        (of.INFOS_HEARD, sensor_data, "subscription", {"history": "keep_all"}, "a slow reader would fill the memory"),
        (of.TRANSFORMS_SAID, reliable, "publisher", {"reliability": "best_effort"}, "tf2's listeners ask for reliable"),
        (of.LATCHED_SAID, latched, "publisher", {"durability": "volatile"}, "it is said once"),
        (of.MOTION_SAID, reliable, "publisher", {"liveliness": "manual_by_topic"}, "nobody asserts it here"),
        (of.FIXED, reliable, "publisher", {"depth": 5}, "one that is lost between them is lost for good"),
    ]
    for may, quality, kind, policies, complaint in cases:
        name = f"qos_overrides./left/topic.{kind}"
        with pytest.raises(SettingsError, match=complaint) as error:
            node, overrides = given({f"{name}.{policy}": value for policy, value in policies.items()})
            options = may.options(overrides, "/left/topic", kind)
            make = node.create_publisher if kind == "publisher" else node.create_subscription
            more = () if kind == "publisher" else (print,)
            make(String, "left/topic", *more, quality(7), qos_overriding_options=options)
        assert name in str(error.value)


def test_a_middleware_that_knows_few_events_will_do(graph: Any) -> None:
    from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError

    from bodycam_ros.nodes.flow_of_frames import Skipped
    from bodycam_ros.nodes.topic_events import TopicEvents

    asked: list[SubscriptionEventCallbacks] = []

    def subscribe(callbacks: SubscriptionEventCallbacks) -> Any:
        asked.append(callbacks)
        if callbacks.liveliness:
            raise UnsupportedEventTypeError("liveliness")
        return "subscribed"

    assert TopicEvents("/left/image_raw", Skipped(print)).subscribed(subscribe) == "subscribed"
    assert asked[-1].incompatible_qos and not (asked[-1].deadline or asked[-1].message_lost)


def test_what_is_overridden_counts_and_the_rest_stays(given: Any) -> None:
    from rclpy.qos import ReliabilityPolicy
    from std_msgs.msg import String

    from bodycam_ros.nodes.qos import reliable, sensor_data
    from bodycam_ros.nodes.qos_overrides import IMAGES_HEARD, MOTION_SAID

    said, others = "qos_overrides./joint_states.publisher", "qos_overrides./tf.publisher.reliability"
    node, overrides = given({f"{said}.reliability": "best_effort", f"{said}.depth": 3, others: "best_effort"})
    quality = reliable(200)
    options = MOTION_SAID.options(overrides, "/joint_states", "publisher")
    node.create_publisher(String, "joint_states", quality, qos_overriding_options=options)
    assert (quality.reliability, quality.depth) == (ReliabilityPolicy.BEST_EFFORT, 3)
    heard = sensor_data(60)
    options = IMAGES_HEARD.options(overrides, "/left/image_raw", "subscription")
    node.create_subscription(String, "left/image_raw", print, heard, qos_overriding_options=options)
    assert (heard.reliability, heard.depth) == (ReliabilityPolicy.RELIABLE, 60), "nothing is overridden"
    # Whoever dumps the parameters gets what was given, of this node's own topics.
    assert node.get_parameter(f"{said}.depth").value == 3 and not node.has_parameter(others)
    assert node.get_parameter(f"{_IMAGES}.reliability").value == "best_available"


def test_lateness_silence_and_strangers_are_told(graph: Any) -> None:
    """One camera that promises how often it speaks, and one that is read more reliably than it speaks."""
    from rclpy.duration import Duration
    from rclpy.qos import LivelinessPolicy

    from bodycam_ros.nodes.qos import best_effort, latched, reliable

    promise = reliable(100)
    promise.deadline = Duration(nanoseconds=1_000_000_000)
    promise.liveliness, promise.liveliness_lease_duration = LivelinessPolicy.MANUAL_BY_TOPIC, promise.deadline
    left = DrivenCamera(graph, "left", promise, latched())
    right = DrivenCamera(graph, "right", best_effort(100), latched())
    graph.listen(_DIAGNOSTICS | {f"/{name}/tracks": "bodycam_msgs/msg/FeatureTracks" for name in ("left", "right")})
    expecting = {f"{_IMAGES}.deadline": 1_500_000_000, f"{_IMAGES}.liveliness_lease_duration": 1_500_000_000}
    strict = {"qos_overrides./right/image_raw.subscription.reliability": "reliable"}
    left.inform()
    right.inform()
    graph.start(*(each.read_by(given) for each, given in ((left, expecting), (right, strict))))
    images = iter(stamps(0, 1000))

    def counts(name: str) -> dict[str, Any]:
        if left.is_due():
            stamp = next(images)
            left.show([stamp])
            right.show([stamp])
        return graph.diagnostics(f"tracker_{name}: camera {name}")

    graph.until(lambda: counts("left").get("text") == "tracking", _START_S, "who keeps its promise is heard")
    graph.until(lambda: counts("right").get(_INCOMPATIBLE) == "1", _SOON_S, "who offers less is counted")
    assert not graph.heard["/right/tracks"], "the user wants it reliable or not at all"
    (warning,) = [line for line in graph.started[1].printed.splitlines() if "offers less" in line]
    for text in ("/right/image_raw", "reliability", f"{next(iter(strict))}"):
        assert text in warning

    def is_told() -> bool:
        report = graph.diagnostics("tracker_left: camera left")
        return {_MISSED, _SILENT} <= report.keys()

    graph.until(is_told, _SOON_S, "that it falls silent is told in both ways")
    # A busy machine may have made it late before.
    missed = int(graph.diagnostics("tracker_left: camera left")[_MISSED])

    def goes_on() -> bool:
        return int(graph.diagnostics("tracker_left: camera left")[_MISSED]) > missed

    graph.until(goes_on, _SOON_S, "each one counts")
    assert set(graph.end().values()) == {0}, graph.report()
