"""Worker processes that start at once: forked from one that has loaded what they need."""

import multiprocessing
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import forkserver, resource_tracker
from multiprocessing.context import ForkServerContext

from bodycam_ros.kernels import prepare_kernels

_WARM = "bodycam_ros.offline.warm_worker"


def warm_up() -> None:
    """Start to load what the processes need, in the background; compile missing kernels first."""
    prepare_kernels()
    with ready_to_start() as context:
        context.set_forkserver_preload([_WARM])
        forkserver.ensure_running()


@contextmanager
def ready_to_start() -> Iterator[ForkServerContext]:
    """Processes that are started in this block never receive the signals that end us, not even while they start.

    Ctrl-C and a closed terminal signal a whole group of processes; the parent alone handles them, and kills the others.
    Signals that are blocked here stay blocked there; here they are delivered when the block ends.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        with _handled_later():
            resource_tracker.ensure_running()  # it would unblock the others
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
            yield multiprocessing.get_context("forkserver")
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _handled_later() -> Iterator[None]:
    """Signals that end us are handled when the block is over.

    A mask holds for a thread, and a library's other threads may receive the signal: Python would still handle it in
    this one, and leave a process that is half started.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    handlers = {number: signal.getsignal(number) for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM)}
    handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in handlers:
        signal.signal(number, lambda number, frame: received.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for first in received[:1]:
            signal.raise_signal(first)
