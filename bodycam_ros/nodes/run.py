"""A node's life: it starts, works until it fails or is told to stop, and goes without a traceback."""

import logging
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import Any

import cv2
import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions

from bodycam_ros.errors import BodycamError
from bodycam_ros.nodes.farewell import leave_ros
from bodycam_ros.nodes.stage_node import StageNode

FAILED = 1
"""Exit code after an error of the user's."""


def run(make_node: Callable[[], StageNode[Any]], name: str) -> int:
    """Run a node until it fails, or SIGINT, SIGTERM or SIGHUP comes; the exit code."""
    cv2.setNumThreads(1)
    logging.basicConfig(level=logging.WARNING, format="[%(levelname)s] %(message)s")
    signals = Signals()
    try:
        # Own handlers: rclpy's close the context at once, and a second signal, which a launch file sends, while the
        # node is being destroyed would end in a traceback.
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except (rclpy_implementation.RCLError, rclpy_implementation.RCLInvalidROSArgsError) as error:
        return say(name, error)
    try:
        try:
            node = make_node()
        except rclpy_implementation.RCLError as error:
            # DDS does not let it take part: it lacks keys, or this Fast DDS has no security.
            return say(name, BodycamError(" ".join(str(error).split())))
        node.bring_up()
        node.work(signals.have_come)
        if node.failure is not None:
            return say(name, node.failure)
        node.moments.write()
        node.leave()
    except BodycamError as error:
        return say(name, error)
    finally:
        # A second signal must not cut the farewell short, not even while Python itself winds up.
        signals.ignore()
        leave_ros(StageNode.made)
    return 0


class Signals:
    """Notes what is sent to end a process, also by a terminal that is closed."""

    def __init__(self) -> None:
        self._come = False
        self._numbers = [signal.SIGINT, signal.SIGTERM]
        # nohup
        if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
            self._numbers.append(signal.SIGHUP)
        for number in self._numbers:
            signal.signal(number, self._note)

    def ignore(self) -> None:
        """From now on they do nothing."""
        for number in self._numbers:
            signal.signal(number, signal.SIG_IGN)

    def have_come(self) -> bool:
        """Whether one has come."""
        return self._come

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._come = True


def say(name: str, error: Exception) -> int:
    """Print an error of the user's as one line; the exit code."""
    # The terminal may be gone.
    with suppress(OSError):
        print(f"{name}: error: {error}", file=sys.stderr, flush=True)
    return FAILED
