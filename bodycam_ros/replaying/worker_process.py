"""Worker processes that start at once: forked from one that has loaded what they need."""

import errno
import multiprocessing
import os
import resource
import signal
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import forkserver, resource_tracker
from multiprocessing.context import ForkServerContext

from bodycam_ros.errors import RecordingError
from bodycam_ros.kernels import load_kernels

_WARM = "bodycam_ros.replaying.warm_worker"

_LONGEST_ADDRESS = 107  # [bytes] of a socket in the file system
_SOCKET = "/pymp-xxxxxxxx/listener-xxxxxxxx"
_SHORT_FOLDERS = ("/tmp", "/var/tmp", "/dev/shm", "/run/lock")

_FEWEST_FILES = 24  # open at a time, with one process

_REMEDIES = {
    errno.EMFILE: "allow more open files (ulimit -n 1024), or give fewer processes (--jobs)",
    errno.ENFILE: "the machine has too many open files",
    errno.EAGAIN: "allow more processes (ulimit -u), or give fewer (--jobs)",
    errno.ENOMEM: "there is not enough memory; give fewer processes (--jobs)",
}
_SHARED_MEMORY = "processes share memory in /dev/shm: is it there, writable, and has it room?"


def warm_up() -> None:
    """Start to load what the processes need, in the background.

    Raises:
        KernelError: the compiled kernels cannot be loaded.
        RecordingError: the system refuses a process.
    """
    load_kernels()
    with refusal_named(), ready_to_start() as context, _short_temporary_folder():
        if 0 <= resource.getrlimit(resource.RLIMIT_NOFILE)[0] < _FEWEST_FILES:
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))  # the forking process would print a traceback
        context.set_forkserver_preload([_WARM])
        forkserver.ensure_running()


@contextmanager
def refusal_named() -> Iterator[None]:
    """Raise as RecordingError what the system says when it refuses a process, or what processes talk through."""
    try:
        yield
    except (OSError, EOFError) as error:
        number = error.errno if isinstance(error, OSError) else errno.EMFILE  # the forking process could not begin
        remedy = _REMEDIES.get(number or 0, _SHARED_MEMORY)
        problem = error.strerror if isinstance(error, OSError) and error.strerror else "the first one ended at once"
        raise RecordingError(f"the tracking processes cannot be started: {problem}; {remedy}") from error


@contextmanager
def _short_temporary_folder() -> Iterator[None]:
    """Sockets of multiprocessing that are made in this block lie where the system takes their names.

    Later versions of Python do so themselves.

    Raises:
        RecordingError: TMPDIR's name is too long, and there is no other place.
    """
    before, named = tempfile.tempdir, tempfile.gettempdir()
    if len(os.fsencode(named + _SOCKET)) > _LONGEST_ADDRESS:
        usable = [folder for folder in _SHORT_FOLDERS if os.access(folder, os.W_OK | os.X_OK)]
        if not usable:
            raise RecordingError(
                f"{named}: the name of this folder (TMPDIR) is too long for a socket; set a shorter one"
            )
        tempfile.tempdir = usable[0]
    try:
        yield
    finally:
        tempfile.tempdir = before


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
