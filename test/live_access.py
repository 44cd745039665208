"""Whether the nodes of a running graph use what ``access_table`` says of them, and nothing else."""

import time
from collections.abc import Iterable, Sequence
from typing import Any

from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.secured.access import Access
from bodycam_ros.secured.access_table import access_of_graph

_SAID_WITHIN_S = 15.0

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
        # What a node has is said by a message of its own, which may come after all that the test has waited for.
        deadline_s = time.monotonic() + _SAID_WITHIN_S
        while (differences := _differences(graph, name, namespace, may)) and time.monotonic() < deadline_s:
            graph.hear(0.1)
        assert not differences, f"{name}: {'; '.join(differences)}\n{graph.report()}"


def _differences(graph: Any, name: str, namespace: str, may: Access) -> list[str]:
    """What a node does and may not, or may and does not."""
    does = graph.endpoints(name, namespace)
    found = []
    for deed, listed in {"publishes": may.publishes, "subscribes": may.subscribes, "serves": may.serves}.items():
        unused = (each for each in listed - does[deed] if "/_action/" not in each)
        idle = {each for each in unused if not each.endswith((*_AT_TIMES, *_OF_SOME))}
        found += [f"{deed} what the table lacks: {each}" for each in sorted(does[deed] - listed)]
        found += [f"the table says that it {deed} {each}" for each in sorted(idle)]
    return found + ([] if does["calls"] == may.calls else [f"calls {sorted(does['calls'])}"])
