"""Whether the nodes of a running graph use what ``access_table`` says of them, and nothing else."""

import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.secured.access import Access
from bodycam_ros.secured.access_table import access_of_graph

_FOUND_WITHIN_S = 15.0
_PREFIX = 12
"""Bytes of an endpoint's identity that are those of its participant, which is a process."""

_AT_TIMES = ("/clock", "/camera_info", "/timing", "/image_raw", "/compressed", "/compressed_video", "/foxglove")
"""Endings of topics that are used only with a simulation's clock or a certain transport."""

_OF_SOME = (
    "/map/points",
    "/equipment",
    "/calibrate",
    "/start_calibration",
    "/tf",
    "/tf_static",
    "/clock_asked",
    "/clock_told",
)
"""Endings of what is used only with some parameters, where tf2_msgs is installed, or between computers."""


def assert_as_listed(graph: Any, nodes: Sequence[NodeProcess], running: Iterable[str]) -> None:
    """Compare what DDS has found of nodes with the table.

    Args:
        graph: the ``live_graph.Graph``, whose listener looks.
        nodes: of the whole graph.
        running: names of those to look at, all of whose endpoints have been found.
    """
    for name in running:
        (node,) = (node for node in nodes if node.name == name)
        may = access_of_graph(nodes)[name].resolved(node.namespace, name)
        namespace = f"/{node.namespace.strip('/')}"
        # Discovery may come after all that the test has waited for.
        deadline_s = time.monotonic() + _FOUND_WITHIN_S
        while (differences := _differences(graph, name, namespace, may)) and time.monotonic() < deadline_s:
            graph.hear(0.1)
        assert not differences, f"{name}: {'; '.join(differences)}\n{graph.report()}"


def _differences(graph: Any, name: str, namespace: str, may: Access) -> list[str]:
    """What a node does and may not, or may and does not."""
    does = _endpoints(graph.listener, f"{namespace.rstrip('/')}/{name}")
    found = []
    for deed, listed in {"publishes": may.publishes, "subscribes": may.subscribes, "serves": may.serves}.items():
        unused = (each for each in listed - does[deed] if "/_action/" not in each)
        idle = {each for each in unused if not each.endswith((*_AT_TIMES, *_OF_SOME))}
        found += [f"{deed} what the table lacks: {each}" for each in sorted(does[deed] - listed)]
        found += [f"the table says that it {deed} {each}" for each in sorted(idle)]
    return found + ([] if does["calls"] == may.calls else [f"calls {sorted(does['calls'])}"])


def _endpoints(listener: Any, full_name: str) -> dict[str, set[str]]:
    """Names of what a node's process publishes, subscribes, serves and calls.

    DDS's own discovery is asked whose endpoints there are. What ROS lists by a node's name comes from a message that
    the node sends, whose last state was seen to stay away.
    """
    topics = [name for name, _ in listener.get_topic_names_and_types(no_demangle=True)]
    writers = {topic: _participants(listener.get_publishers_info_by_topic, topic) for topic in topics}
    readers = {topic: _participants(listener.get_subscriptions_info_by_topic, topic) for topic in topics}
    own = writers.get(f"rr{full_name}/get_parametersReply", set())

    def names(found: dict[str, set[bytes]], kind: str, ending: str = "") -> set[str]:
        ours = (topic for topic, participants in found.items() if own & participants)
        return {topic.removeprefix(kind).removesuffix(ending) for topic in ours if topic.startswith(f"{kind}/")}

    return {
        "publishes": names(writers, "rt"),
        "subscribes": names(readers, "rt"),
        "serves": names(readers, "rq", "Request"),
        "calls": names(writers, "rq", "Request"),
    }


def _participants(look: Callable[..., list[Any]], topic: str) -> set[bytes]:
    return {bytes(each.endpoint_gid)[:_PREFIX] for each in look(topic, no_mangle=True)}
