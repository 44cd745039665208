"""Which enclaves a live graph needs, and what the holder of each may do."""

from collections.abc import Sequence

from bodycam_ros.nodes.graph import NodeProcess, cameras_of, stations_of
from bodycam_ros.secured.access import Access
from bodycam_ros.secured.access_table import access_of_graph, drivers, people, state_publisher

WHOLE = "graph"
"""Enclave of a process that is the whole graph."""

STATE_PUBLISHER = "robot_state_publisher"


def enclaves_of(graph: Sequence[NodeProcess], namespace: str = "/") -> dict[str, Access]:
    """Enclave -> what its holder may do, all names absolute.

    There is one for each node, named after it, one for the whole graph in one process, one for the driver of each
    camera, one for robot_state_publisher, and two for people with tools: ``observer`` and ``operator``.

    Args:
        graph: all nodes.
        namespace: that they run in.
    """
    root = f"/{namespace.strip('/')}".rstrip("/")
    nodes = {name: access.resolved(root, name) for name, access in access_of_graph(graph).items()}
    # By such a topic the process finds out whether its nodes hear each other without the middleware.
    probes = frozenset(f"{root}/{name}/is_heard_within" for name in nodes)
    whole = Access(probes, probes)
    for access in nodes.values():
        whole |= access
    of_others = drivers(cameras_of(graph), stations_of(graph)) | {STATE_PUBLISHER: state_publisher()}
    others = {name: access.resolved(root, name) for name, access in of_others.items()}
    return {f"{root}/{name}": access for name, access in (nodes | {WHOLE: whole} | others | people(nodes)).items()}
