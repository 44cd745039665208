"""A command that another one of ours has started ends with it, even where that is killed and can end nothing.

The starter holds the one end of a pipe, which the system closes with its process; the command watches the other end.
"""

import os
import signal
import threading
import time
from collections.abc import Mapping
from contextlib import suppress

_VARIABLE = "BODYCAM_PARENT_PIPE"
_CLEANUP_S = 20.0


class ParentPipe:
    """The starter's end, which stays open as long as this process lives.

    Attributes:
        descriptor: of the other end, to be passed on to commands.
    """

    def __init__(self) -> None:
        self.descriptor, self._own = os.pipe()

    def environment(self) -> Mapping[str, str]:
        """Environment for a command that is given the descriptor."""
        return {**os.environ, _VARIABLE: str(self.descriptor)}

    def close(self) -> None:
        """Close both ends; what still watches ends."""
        os.close(self.descriptor)
        os.close(self._own)


def end_with_parent() -> None:
    """End this process by SIGTERM, which lets it clean up, when the command that started it is gone.

    Does nothing in one that a user has started.
    """
    given = os.environ.pop(_VARIABLE, "")
    if given.isdecimal():
        threading.Thread(target=_end_after, args=(int(given),), daemon=True, name="parent watch").start()


def _end_after(descriptor: int) -> None:
    with suppress(OSError):  # it is no descriptor of ours: somebody else has set the variable
        if os.read(descriptor, 1):
            return
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_CLEANUP_S)
        os.killpg(0, signal.SIGKILL)
