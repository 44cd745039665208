"""How a command ends on SIGINT, SIGTERM or SIGHUP: it cleans up and exits with 128 + the signal, without a traceback.

While a command starts there is nothing to clean up, so it ends at once: an exception in the middle of an import could
be swallowed, or shown. Once it runs, the signal becomes an exception that unwinds it.
"""

import os
import signal
import sys
import time
from contextlib import suppress
from types import FrameType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

_PATIENCE_S = 3.0
"""Signals within this time of the last are the same wish: a closed terminal sends two, and cleaning takes a while."""

_MOMENT_S = 0.01


class Interrupted(KeyboardInterrupt):
    """Ctrl-C. ``python -m`` kills itself in the end where a KeyboardInterrupt itself has left an ``exec``.

    A dataclass that is imported is made by one; that somebody catches the exception makes no difference.
    """


class Ending:
    """Answers the signals that end a program.

    Attributes:
        cause: the signal that came, if any.
    """

    def __init__(self) -> None:
        self.cause: signal.Signals | None = None
        self._running = False
        self._latest = -_PATIENCE_S
        self._before: dict[signal.Signals, Any] = {}

    @property
    def exit_code(self) -> int:
        """128 + the signal that came."""
        return 128 + (self.cause or 0)

    def answer(self) -> None:
        """Answer the signals from now on, except those that somebody before us chose to ignore (nohup)."""
        for number in SIGNALS:
            before = signal.getsignal(number)
            if before != signal.SIG_IGN:
                self._before.setdefault(number, before)
                signal.signal(number, self._on_signal)
        sys.unraisablehook = self._on_unraisable

    def begin(self) -> None:
        """From now on there is something to clean up."""
        self._running = True

    def end(self) -> None:
        """From now on there is nothing any more."""
        self._running = False

    def forget(self) -> None:
        """Leave the signals as they were."""
        for number, before in self._before.items():
            signal.signal(number, before)
        sys.unraisablehook = sys.__unraisablehook__

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.cause = signal.Signals(number)
        if not self._running:
            self.say()
            os._exit(self.exit_code)
        now = time.monotonic()
        if now - self._latest < _PATIENCE_S:
            return
        self._latest = now
        if number == signal.SIGINT:
            raise Interrupted
        raise SystemExit(self.exit_code)

    def say(self) -> None:
        """Tell whoever pressed Ctrl-C; a terminal that is gone is no reason to fail."""
        if self.cause == signal.SIGINT:
            with suppress(OSError, ValueError):
                print("bodycam: interrupted", file=sys.stderr, flush=True)

    def _on_unraisable(self, unraisable: Any) -> None:
        """A signal that came while an object was destroyed is lost there: it comes again."""
        if self.cause is not None and issubclass(unraisable.exc_type, (KeyboardInterrupt, SystemExit)):
            self._latest = -_PATIENCE_S
            # Not at once: raised in here it would be lost, too.
            signal.signal(signal.SIGALRM, lambda _, frame: self._on_signal(int(self.cause or 0), frame))
            signal.setitimer(signal.ITIMER_REAL, _MOMENT_S)
        else:
            sys.__unraisablehook__(unraisable)


def let_go_of_the_terminal() -> None:
    """Send what is still to be printed nowhere: the reader of a pipe, or the terminal, is gone."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            os.dup2(nowhere, stream.fileno())
