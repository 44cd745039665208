"""The live graph in one process: every node on a thread of its own, for small machines and for debuggers.

What nodes say to each other stays in the process (``in_process.py``); who listens outside of it hears what it always
hears.
"""

import threading
from collections.abc import Callable, Sequence

import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from bodycam_ros.errors import BodycamError
from bodycam_ros.nodes.composable_node import ComposableNode
from bodycam_ros.nodes.farewell import leave_ros
from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.nodes.in_process import InProcessTopics
from bodycam_ros.nodes.node_classes import made
from bodycam_ros.nodes.own_profile import deaf_to_itself, is_deaf_to_itself
from bodycam_ros.nodes.run import FAILED, Signals, say
from bodycam_ros.nodes.stage_node import StageNode

NAME = "graph"

_LOOK_S = 0.1


def run_in_one(processes: Sequence[NodeProcess], signals: Signals) -> int:
    """Run nodes in this process until a signal comes, one of them fails, or all have ended; the exit code."""
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
    errors = {str(each.error): (each.name, each.error) for each in running if each.error is not None}
    for name, failure in errors.values():
        say(name, failure)
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
        self._node = made(process)
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
