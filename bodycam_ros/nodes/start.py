"""Starts a node in its process: ``ros2 run bodycam_ros tracker``, or ``python -m bodycam_ros.nodes.start tracker``.

``graph`` runs all nodes in one process. The package is imported in functions, after the number of threads of NumPy and
OpenCV is set.
"""

import os
import signal

# Until the node handles signals they end the process at once: half-loaded libraries would print a traceback. The launch
# file starts it with both blocked, for before this line it is Python's own start that they would hit.
ENDING = (signal.SIGINT, signal.SIGTERM)
for _number in ENDING:
    signal.signal(_number, lambda *_: os._exit(0))
signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)

# ruff: noqa: E402
import sys
from contextlib import suppress
from functools import partial
from importlib import import_module
from typing import Any, NoReturn

NODES = ("tracker", "registration", "skeleton_solver", "retarget", "player")
GRAPH = "graph"


def _run(name: str) -> NoReturn:
    if {"--help", "-h"} & {*sys.argv[1:]} and name != GRAPH:
        print(import_module("bodycam_ros.graph.node_parameters").help_text(name))
        _end(0)
    import_module("bodycam_ros.files.bounded_inputs").bound_inputs()
    # Every camera has a process of its own, so that more threads would only compete.
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    wanted = import_module("bodycam_ros.graph.declared_graph").from_command_line(sys.argv[1:]) if name == GRAPH else ()
    if name != "player":
        try:
            import_module("bodycam_ros.kernels").load_kernels()
        except import_module("bodycam_ros.errors").KernelError as error:
            sys.exit(str(error))
    run: Any = import_module("bodycam_ros.nodes.process").run
    if name == GRAPH:
        _end(run(name, *(partial(_node(node.executable), node.arguments()) for node in wanted)))
    _end(run(name, _node(name)))


def _node(executable: str) -> Any:
    """Constructor of the executable's node."""
    return import_module(f"bodycam_ros.nodes.{executable}").make


def _end(code: int) -> NoReturn:
    for stream in (sys.stdout, sys.stderr):
        # The terminal may be gone.
        with suppress(OSError):
            stream.flush()
    # The nodes have left ROS. Unloading Python, OpenCV and Fast DDS would take ten times as long.
    os._exit(code)


tracker, registration, skeleton_solver, retarget, player, graph = (partial(_run, name) for name in (*NODES, GRAPH))
"""Entry points of the executables."""

if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in (*NODES, GRAPH):
        sys.exit(f"usage: python -m bodycam_ros.nodes.start {{{','.join((*NODES, GRAPH))}}} [--ros-args ...]")
    _run(sys.argv.pop(1))
