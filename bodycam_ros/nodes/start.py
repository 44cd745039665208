"""Starts a node in its process: ``ros2 run bodycam_ros tracker``, or ``python -m bodycam_ros.nodes.start tracker``.

The nodes are imported here and not above, because some things must be settled before NumPy and OpenCV are loaded.
"""

import os
import signal
import sys
from contextlib import suppress
from importlib import import_module
from typing import NoReturn

NODES = ("tracker", "region_tracker", "registration", "skeleton_solver", "retarget", "humans", "player", "graph")

_GRAPH = "graph_command"
"""The module of ``graph``; that of this name tells which nodes there are."""


def tracker() -> NoReturn:
    """Run the tracker of one camera."""
    _run("tracker")


def region_tracker() -> NoReturn:
    """Run the region tracker of one static camera."""
    _run("region_tracker")


def registration() -> NoReturn:
    """Run the registration of all cameras."""
    _run("registration")


def skeleton_solver() -> NoReturn:
    """Run the solver of the body."""
    _run("skeleton_solver")


def retarget() -> NoReturn:
    """Run a robot that follows the body."""
    _run("retarget")


def humans() -> NoReturn:
    """Describe the body as REP-155 does."""
    _run("humans")


def player() -> NoReturn:
    """Play a bag."""
    _run("player")


def graph() -> NoReturn:
    """Run all nodes, in one process or forked from it."""
    _run("graph")


def _run(name: str) -> NoReturn:
    # Until the node listens to signals itself Ctrl-C just ends it: half-loaded libraries would give a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Every camera has a process, so threads inside one would only get in the others' way.
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    if name != "player":
        preparation = import_module("bodycam_ros.kernels.preparation")
        preparation.prepare_kernels()
        preparation.load_kernels()
    code: int = import_module(f"bodycam_ros.nodes.{_GRAPH if name == 'graph' else name}").main()
    for stream in (sys.stdout, sys.stderr):
        # The terminal may be gone.
        with suppress(OSError):
            stream.flush()
    # The node has left ROS and said all it had to. Unloading Python, OpenCV, gtsam and Fast DDS takes ten times as long
    # as that, and tells nobody anything.
    os._exit(code)


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in NODES:
        sys.exit(f"usage: python -m bodycam_ros.nodes.start {{{','.join(NODES)}}} [--ros-args ...]")
    _run(sys.argv.pop(1))
