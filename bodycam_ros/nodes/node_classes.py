"""What each node of the live graph is, for those who run several of them; what is not run is not imported."""

from importlib import import_module
from typing import Any

from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.nodes.stage_node import StageNode

_CLASSES = {
    "tracker": "Tracker",
    "region_tracker": "RegionTracking",
    "registration": "Registration",
    "skeleton_solver": "SkeletonSolver",
    "retarget": "RetargetNode",
    "humans": "HumansNode",
    "player": "Player",
}
"""Executable, which is the name of its module -> class of the node."""


def made(process: NodeProcess) -> StageNode[Any]:
    """The node of a process of the graph, in this process.

    Raises:
        BodycamError: its parameters are not what they should be.
    """
    node: StageNode[Any] = getattr(imported(process.executable), _CLASSES[process.executable])(process.arguments())
    return node


def imported(executable: str) -> Any:
    """The module of a node."""
    return import_module(f"bodycam_ros.nodes.{executable}")
