"""One run at a time uses a folder of results, and the steps of a run end with it, even where it is killed.

The system releases a lock with the process that holds it: what waits for the lock knows that the run is gone.
"""

import fcntl
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from bodycam_ros.errors import StudyError
from bodycam_ros.files.whole_file import failure_named

LOCK = ".bodycam-study"
VARIABLE = "BODYCAM_STUDY_LOCK"
"""Environment variable with the path of the lock, for processes that end with the run."""

_CLEANUP_S = 20.0


@contextmanager
def study_lock(folder: Path) -> Iterator[Path]:
    """Lock the folder of results, which is made if it is missing; gives the path of the lock.

    Raises:
        StudyError: another run uses the folder, or steps of one that was killed still clean up.
        OutputError: the folder cannot be written to.
    """
    path = folder / LOCK
    with failure_named(path):
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise StudyError(f"{folder}: another 'bodycam study' or 'bodycam run' is at work in it; wait") from error
        except OSError:
            pass  # some file systems have no locks
        yield path
    finally:
        os.close(descriptor)


def end_with_study(number: signal.Signals = signal.SIGTERM) -> None:
    """End this process by a signal, which lets it clean up, when the run that started it is gone.

    It holds the lock while it cleans up, so that no other run begins meanwhile. Does nothing in a process that a user
    has started.
    """
    if path := os.environ.pop(VARIABLE, ""):
        threading.Thread(target=_end_after, args=(path, number), daemon=True, name="study watch").start()


def _end_after(path: str, number: signal.Signals) -> None:
    with suppress(OSError):  # somebody else has set the variable
        fcntl.flock(os.open(path, os.O_RDONLY | os.O_CLOEXEC), fcntl.LOCK_SH)
        os.kill(os.getpid(), number)
        time.sleep(_CLEANUP_S)
        os.kill(os.getpid(), signal.SIGKILL)
