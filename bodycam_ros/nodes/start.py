"""Starts a node in its process: ``ros2 run bodycam_ros tracker``, or ``python -m bodycam_ros.nodes.start tracker``.

The nodes are imported here and not above, because some things must be settled before NumPy and OpenCV are loaded.
"""

import os
import signal
import sys
from importlib import import_module

NODES = ("tracker", "registration", "skeleton_solver", "player")


def tracker() -> int:
    """Run the tracker of one camera."""
    return _run("tracker")


def registration() -> int:
    """Run the registration of all cameras."""
    return _run("registration")


def skeleton_solver() -> int:
    """Run the solver of the body."""
    return _run("skeleton_solver")


def player() -> int:
    """Play a bag."""
    return _run("player")


def _run(name: str) -> int:
    # Until the node listens to signals itself Ctrl-C just ends it: half-loaded libraries would give a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Every camera has a process, so threads inside one would only get in the others' way.
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    code: int = import_module(f"bodycam_ros.nodes.{name}").main()
    return code


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in NODES:
        sys.exit(f"usage: python -m bodycam_ros.nodes.start {{{','.join(NODES)}}} [--ros-args ...]")
    sys.exit(_run(sys.argv.pop(1)))
