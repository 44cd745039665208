"""The live graph in one process: every node on a thread of its own, for small machines and for debuggers.

ros2 run bodycam_ros graph --map MAP --body BODY.yaml [--bag BAG] [--ros-args --params-file SETTINGS.yaml]

What nodes say to each other stays in the process (``in_process.py``); who listens outside of it hears what it always
hears.
"""

import argparse
import logging
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from bodycam_ros.errors import BodycamError
from bodycam_ros.nodes.composable_node import ComposableNode
from bodycam_ros.nodes.farewell import leave_ros
from bodycam_ros.nodes.graph import (
    NodeProcess,
    cameras_of,
    follower,
    human,
    live_graph,
    outside_input,
    player,
    stations_of,
)
from bodycam_ros.nodes.humans import HumansNode
from bodycam_ros.nodes.in_process import InProcessTopics
from bodycam_ros.nodes.own_profile import deaf_to_itself, is_deaf_to_itself
from bodycam_ros.nodes.player import Player
from bodycam_ros.nodes.region_tracker import RegionTracking
from bodycam_ros.nodes.registration import Registration
from bodycam_ros.nodes.retarget import RetargetNode
from bodycam_ros.nodes.run import FAILED, Signals, say
from bodycam_ros.nodes.skeleton_solver import SkeletonSolver
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.nodes.tracker import Tracker

NAME = "graph"

_CLASSES: dict[str, Callable[[Sequence[str]], StageNode[Any]]] = {
    "tracker": Tracker,
    "region_tracker": RegionTracking,
    "registration": Registration,
    "skeleton_solver": SkeletonSolver,
    "retarget": RetargetNode,
    "humans": HumansNode,
    "player": Player,
}

_LOOK_S = 0.1


def main() -> int:
    """Run the graph until it is stopped, or a node fails; the exit code."""
    cv2.setNumThreads(1)
    logging.basicConfig(level=logging.WARNING, format="[%(levelname)s] %(message)s")
    signals = Signals()
    try:
        processes = _processes(_parser().parse_args(remove_ros_args(sys.argv)[1:]))
    except BodycamError as error:
        return say(NAME, error)
    try:
        with deaf_to_itself():
            # As in ``run``.
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
            _share_topics()
    except (rclpy_implementation.RCLError, rclpy_implementation.RCLInvalidROSArgsError) as error:
        return say(NAME, error)
    try:
        return _run(processes, signals.have_come)
    finally:
        signals.ignore()
        leave_ros(StageNode.made)


def _processes(arguments: argparse.Namespace) -> list[NodeProcess]:
    """What ``bodycam.launch.py`` starts."""
    graph = live_graph(
        arguments.map,
        arguments.body,
        arguments.cameras,
        arguments.registrations,
        arguments.rig,
        arguments.overwrite_body,
        arguments.grown_map,
        arguments.equipment,
        outside_input(arguments.stations, arguments.surface, arguments.start),
    )
    graph += follower(arguments.robot, arguments.mapping) + human(arguments.humans)
    if arguments.bag is not None:
        graph.append(player(arguments.bag, arguments.rate, cameras_of(graph), arguments.loop, stations_of(graph)))
    return graph


def _share_topics() -> None:
    """Let nodes hear each other directly, unless they would hear each other through the middleware as well.

    The node that is made to find that out stays: with the last node of a process its DDS participant goes, too.
    """
    first = rclpy.create_node(NAME)
    StageNode.made.append(first)
    if is_deaf_to_itself(first):
        ComposableNode.topics_within = InProcessTopics()
    else:
        first.get_logger().warning("this middleware carries messages within the process, too, which takes longer")


def _run(processes: Sequence[NodeProcess], stopped: Callable[[], bool]) -> int:
    over = threading.Event()
    running: list[_Running] = []
    for process in processes:
        if stopped():
            return 0
        try:
            running.append(_Running(process, over))
        except BodycamError as error:
            return say(process.name, error)
    for each in running:
        each.start()
    while not (stopped() or any(each.has_failed for each in running)) and any(each.is_alive() for each in running):
        over.wait(_LOOK_S)
    over.set()
    for each in running:
        each.join()
    errors = {str(each.error): each for each in running if each.error is not None}
    for each in errors.values():
        say(each.name, each.error)
    return FAILED if any(each.has_failed for each in running) else 0


class _Running(threading.Thread):
    """A node at work, on a thread of its own with an executor of its own, as it is in a process of its own.

    Numba's kernels and OpenCV let other threads run meanwhile, so that cameras are tracked side by side.

    Args:
        process: what the node is.
        over: set when all are to end.

    Attributes:
        error: the user's, which ended the node.
        has_failed: whether it was ended by that, or by a defect of ours.

    Raises:
        BodycamError: the node cannot be brought up.
    """

    def __init__(self, process: NodeProcess, over: threading.Event) -> None:
        super().__init__(name=process.name)
        self._over = over
        self.error: BodycamError | None = None
        self.has_failed = False
        self._node = _CLASSES[process.executable](process.arguments())
        self._node.bring_up()

    def run(self) -> None:
        """Until it ends by itself, or all are told to."""
        try:
            self._node.work(self._over.is_set)
            if self._node.failure is not None:
                raise self._node.failure
            self._node.moments.write()
            self._node.leave()
        except BodycamError as error:
            self.error = error
            self.has_failed = True
        except BaseException:
            self.has_failed = True
            raise
        if not (self.has_failed or self._over.is_set()):
            # As a process that ends: nobody hears any more what it had latched.
            StageNode.made.remove(self._node)
            self._node.destroy_node()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(NAME, description=__doc__)
    parser.add_argument("--map", type=Path, help="folder of the reference map, made by 'bodycam map'")
    parser.add_argument("--body", type=Path, required=True, help="body YAML; with --rig it is written")
    parser.add_argument("--cameras", nargs="+", default=[], help="those to use; all of the body if not given")
    parser.add_argument("--registrations", type=int, default=1, help="nodes that share the registration")
    parser.add_argument("--grown-map", type=Path, help="folder in which registrations keep what their maps grow by")
    parser.add_argument("--rig", type=Path, help="rig YAML, to make the body from a range of motion (~/calibrate)")
    parser.add_argument("--overwrite-body", action="store_true", help="with --rig: replace a body that is there")
    parser.add_argument("--equipment", default="", help="what the person rides, holds or stands on: a file or a name")
    parser.add_argument("--stations", type=Path, help="YAML of static cameras: where they stand, their lenses")
    parser.add_argument("--surface", type=Path, help="with --stations: folder of the segments' meshes")
    parser.add_argument("--start", type=Path, help="with --stations: YAML of where the person stands at first")
    parser.add_argument("--robot", type=Path, help="URDF of a robot that follows the person")
    parser.add_argument("--mapping", type=Path, help="with --robot: YAML of which links of it follow what")
    parser.add_argument("--humans", default="", metavar="ID", help="REP-155's id of the body, to say all as it does")
    parser.add_argument("--bag", type=Path, help="ros2 bag or .mcap file to play")
    parser.add_argument("--rate", type=float, default=1.0, help="with --bag: times the recorded speed")
    parser.add_argument("--loop", action="store_true", help="with --bag: play it again and again")
    return parser
