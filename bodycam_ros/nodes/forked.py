"""The live graph with a process for every node, forked from one that has loaded what they all need.

A tracker that starts by itself spends most of its start on libraries and kernels, and so do fifteen others beside it.
Loaded once they are there for all of them, and most of their memory is shared.
"""

import ctypes
import gc
import os
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path, PurePosixPath

from bodycam_ros.errors import BodycamError
from bodycam_ros.nodes.graph import NodeProcess
from bodycam_ros.nodes.loaded_map import load_map
from bodycam_ros.nodes.node_classes import imported, made
from bodycam_ros.nodes.run import FAILED, Signals, run
from bodycam_ros.registration.reference_map import ReferenceMap

_LOOK_S = 0.05
_ONCE = ("player",)
"""Executables that are not started again: a bag is played once."""

_ENDS = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
_PR_SET_PDEATHSIG, _PR_SET_NAME = 1, 15
_ENCLAVE = "--enclave"
_MESSAGES = ("bodycam_msgs", "diagnostic_msgs", "geometry_msgs", "nav_msgs", "sensor_msgs", "std_msgs")
"""Packages of the messages that nearly all nodes use."""


def run_forked(processes: Sequence[NodeProcess], respawn_s: float | None, signals: Signals) -> int:
    """Run nodes until all have ended, by themselves or because a signal has come.

    Call it before this process has begun ROS, or has threads other than LTTng's, which wait for a tracer: neither
    survives a fork. Nodes that fail say why themselves; the others go on.

    Args:
        processes: the nodes.
        respawn_s: how long after its end a node is started again; None: never.
        signals: those that end the graph.

    Returns:
        The exit code: 0 if each node's last end was a good one.
    """
    kept = _loaded_for_all(processes)
    waiting = [(0.0, process) for process in processes]
    running: dict[int, NodeProcess] = {}
    codes: dict[str, int] = {}
    is_told = False
    while running or waiting:
        now_s = time.monotonic()
        if signals.have_come():
            waiting.clear()
            if not is_told:
                _tell(running)
                is_told = True
        for each in [each for each in waiting if each[0] <= now_s]:
            waiting.remove(each)
            running[_fork(each[1])] = each[1]
        ended = _ended(running)
        # A terminal's Ctrl-C reaches all of them at once.
        is_over = signals.have_come()
        for pid, code in ended:
            process = running.pop(pid)
            # Who was about to begin ends of the signal itself.
            codes[process.name] = 0 if is_over and -code in _ENDS else code
            if code < 0 and not is_over:
                print(f"{process.name}: killed by signal {-code}", file=sys.stderr, flush=True)
            if respawn_s is not None and process.executable not in _ONCE:
                waiting.append((now_s + respawn_s, process))
        time.sleep(_LOOK_S)
    del kept
    return FAILED if any(codes.values()) else 0


def _loaded_for_all(processes: Sequence[NodeProcess]) -> list[ReferenceMap]:
    """Load what several children would load for themselves; the maps, there for as long as somebody keeps them."""
    for executable, count in Counter(process.executable for process in processes).items():
        if count > 1:
            imported(executable)
    for package in _MESSAGES:
        import_module(f"{package}.msg")
    # rclpy imports it with the first message that is used.
    import_module("rosidl_generator_py")
    maps = []
    for path in {str(process.parameters["map"]) for process in processes if process.parameters.get("map")}:
        # A map that cannot be read is told by those who need it.
        with suppress(BodycamError):
            maps.append(load_map(Path(path)))
    # What is garbage to a child would be written to in pages that it shares with the others.
    gc.collect()
    gc.freeze()
    return maps


def _fork(process: NodeProcess) -> int:
    """Start a node in a child; the child's pid, in the parent alone."""
    parent = os.getpid()
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    # A signal between the fork and the child's own handlers would be noted where nobody looks.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDS)
    pid = os.fork()
    if pid == 0:
        _be_child(process, parent, before)
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return pid


def _be_child(process: NodeProcess, parent: int, mask: Iterable[int]) -> None:
    """Be the node, and end with it."""
    code = FAILED
    try:
        # Who is killed takes its children along; in lists of processes each has the node's name.
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        ctypes.CDLL(None).prctl(_PR_SET_NAME, process.name.encode())
        for number in _ENDS:
            if signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if os.getppid() == parent:
            sys.argv += own_enclave(sys.argv, process.name)
            code = run(lambda: made(process), process.name)
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            # The terminal may be gone.
            with suppress(OSError):
                stream.flush()
        os._exit(code)


def own_enclave(arguments: list[str], name: str) -> list[str]:
    """ROS arguments by which a node has its own keys, where the graph has some: those beside the graph's."""
    given = [value for flag, value in zip(arguments, arguments[1:], strict=False) if flag == _ENCLAVE]
    return ["--ros-args", _ENCLAVE, str(PurePosixPath(given[-1]).with_name(name))] if given else []


def _tell(running: Iterable[int]) -> None:
    for pid in running:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGINT)


def _ended(running: Iterable[int]) -> list[tuple[int, int]]:
    """Children that are gone, with their exit codes; of those that were killed the signal's number, negative."""
    looked = [os.waitpid(pid, os.WNOHANG) for pid in running]
    return [(pid, os.waitstatus_to_exitcode(status)) for pid, status in looked if pid]
