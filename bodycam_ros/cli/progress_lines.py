"""Progress where there is no terminal: a line every ten seconds, also while a step reports nothing."""

import sys
import threading
import time
from contextlib import suppress

from bodycam_ros.cli.signals import EndingSignals
from bodycam_ros.progress import ShownShares

_EVERY_S = 10.0


class ProgressLines(ShownShares):
    """Prints the running step, its share and its time to standard error while the block lasts."""

    def __init__(self) -> None:
        self._step = "start"
        self._share = 0.0
        self._since_s = time.monotonic()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._print_lines, name="progress", daemon=True)

    def __enter__(self) -> "ProgressLines":
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ended.set()
        self._thread.join()

    def show(self, step: str, share: float) -> None:
        """Note that so much of a step is done, 0 to 1; a signal that was lost ends the command here."""
        EndingSignals.check()
        if step != self._step:
            self._step, self._since_s = step, time.monotonic()
        self._share = share

    def _print_lines(self) -> None:
        while not self._ended.wait(_EVERY_S):
            passed_s = time.monotonic() - self._since_s
            with suppress(OSError, ValueError):  # nobody reads it
                print(f"bodycam: {self._step}: {self._share:.0%} after {passed_s:.0f} s", file=sys.stderr, flush=True)
