"""The process of a node, or of several: signals, executors, exit codes, and the end of nodes."""

import faulthandler
import gc
import logging
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import cv2
import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from bodycam_ros.errors import BodycamError
from bodycam_ros.graph.declared_graph import USER_ERROR, without_discovery_callbacks

PATIENCE_S = 60.0
"""Shutdown takes 0.03 s of processor time: after so long it is stuck, however busy the machine is."""

_SPIN_S = 0.2
_POLL_S = 0.1


def run(name: str, *make_nodes: Callable[[], Any]) -> int:
    """Run nodes in this process until one fails, all are done, or SIGINT, SIGTERM or SIGHUP comes; the exit code.

    Each has a thread and an executor of its own: numba's kernels and OpenCV let other threads run meanwhile.

    Args:
        name: of the executable, for its errors.
        make_nodes: make the nodes, which have ``bring_up()``, ``work(stopped)`` until they are done or stopped, and
            ``finish()``, in which publishing still works; all may raise a BodycamError.
    """
    cv2.setNumThreads(1)
    logging.basicConfig(level=logging.WARNING, format="[%(levelname)s] %(message)s")
    ending = [signal.SIGINT, signal.SIGTERM]
    # A terminal that is closed sends SIGHUP; nohup ignores it.
    ending += [] if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN else [signal.SIGHUP]
    received: list[int] = []
    for number in ending:
        signal.signal(number, lambda number, frame: received.append(number))
    nodes: list[Any] = []
    try:
        # rclpy's handlers close the context at once, and nothing could be published or saved any more.
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        for make in make_nodes:
            if received:
                break
            nodes.append(make())
            nodes[-1].bring_up()
        _work(nodes, lambda: bool(received))
    except (BodycamError, rclpy_implementation.RCLError, rclpy_implementation.RCLInvalidROSArgsError) as error:
        # rclpy raises these: without keys DDS does not admit the node, or its ROS arguments are invalid.
        with suppress(OSError):  # the terminal may be gone
            print(f"{name}: error: {' '.join(str(error).split())}", file=sys.stderr, flush=True)
        return USER_ERROR
    finally:
        # A second signal, which a launch file sends, must not cut this short.
        for number in ending:
            signal.signal(number, signal.SIG_IGN)
        leave_ros(nodes)
    return 0


def _work(nodes: Sequence[Any], stopped: Callable[[], bool]) -> None:
    if len(nodes) == 1:
        nodes[0].work(stopped)
        nodes[0].finish()
        return
    over = threading.Event()
    errors: list[BaseException] = []

    def work(node: Any) -> None:
        try:
            node.work(over.is_set)
            node.finish()
        except BaseException as error:
            errors.append(error)
            over.set()

    threads = [threading.Thread(target=work, args=(node,)) for node in nodes]
    for thread in threads:
        thread.start()
    while not (stopped() or over.is_set()) and any(thread.is_alive() for thread in threads):
        over.wait(_POLL_S)
    over.set()
    for thread in threads:
        thread.join()
    for error in errors:
        raise error


def spin(node: Node, stopped: Callable[[], bool]) -> None:
    """Serve a node until it is stopped."""
    executor = light_executor()
    executor.add_node(node)
    never = Future()
    try:
        # In slices: Python handles signals between them, and without a time limit EventsExecutor keeps the interpreter.
        while not stopped():
            try:
                executor.spin_until_future_complete(never, _SPIN_S)
            except rclpy_implementation.RCLError as error:
                # rclpy does not answer a request of a transition that the state of the node does not allow.
                node.get_logger().warning(" ".join(str(error).split()))
    finally:
        executor.remove_node(node)
        executor.shutdown()


def light_executor() -> Executor:
    """The executor that takes half the time per message, if this rclpy has it."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    return EventsExecutor()


def leave_ros(nodes: list[Any]) -> None:
    """Destroy the nodes, to which the list must be the last reference, and end ROS in this process.

    After ``PATIENCE_S`` the process ends with exit code 1 and a traceback.
    """
    faulthandler.dump_traceback_later(PATIENCE_S, exit=True)
    while nodes:
        node = nodes.pop()
        ignore_discovery(node)
        node.destroy_node()
        del node
    # A LifecycleNode's state machine keeps the node in DDS until both are freed.
    gc.collect()
    rclpy.try_shutdown()


def ignore_discovery(node: Node) -> bool:
    """Switch off the discovery callbacks of a node's participant in DDS; whether that was possible."""
    with node.handle:
        return without_discovery_callbacks(node.handle.pointer)
