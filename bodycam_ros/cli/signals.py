"""SIGINT, SIGTERM and SIGHUP end a command by an exception, so that it cleans up; its exit code is 128 + the signal."""

import signal
import sys
import time
from types import FrameType
from typing import Any, ClassVar, Self

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

_REPEATED_S = 3.0
"""A signal within this time of the last one is ignored: a closed terminal sends two, and cleaning up takes a while."""

_DELAY_S = 0.01


class Interrupted(KeyboardInterrupt):
    """Ctrl-C; after a KeyboardInterrupt itself that has left an ``exec``, caught or not, ``python -m`` kills itself."""


class EndingSignals:
    """Answers the signals inside a ``with`` block, except those that are ignored (nohup).

    Attributes:
        received: the signal, if one came.
    """

    _active: ClassVar["EndingSignals | None"] = None

    def __init__(self) -> None:
        self.received: signal.Signals | None = None
        self._time = -_REPEATED_S
        self._before: dict[signal.Signals, Any] = {}

    @property
    def exit_code(self) -> int:
        """128 + the signal that came."""
        return 128 + (self.received or 0)

    def __enter__(self) -> Self:
        for number in SIGNALS:
            before = signal.getsignal(number)
            if before != signal.SIG_IGN:
                self._before[number] = before
                signal.signal(number, self._raise)
        sys.unraisablehook = self._repeat
        EndingSignals._active = self
        return self

    def __exit__(self, *_: object) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)
        sys.unraisablehook = sys.__unraisablehook__
        EndingSignals._active = None

    @classmethod
    def check(cls) -> None:
        """Raise the exception of a signal again that a library has lost, as modules in C do that import others."""
        if (active := cls._active) is not None and active.received is not None:
            active._time = -_REPEATED_S
            active._raise(active.received, None)

    def _raise(self, number: int, frame: FrameType | None) -> None:
        self.received = signal.Signals(number)
        now = time.monotonic()
        if now - self._time < _REPEATED_S:
            return
        self._time = now
        raise Interrupted if number == signal.SIGINT else SystemExit(self.exit_code)

    def _repeat(self, unraisable: Any) -> None:
        """Raise the exception again, soon, if it was lost because it came while an object was destroyed."""
        if self.received is not None and issubclass(unraisable.exc_type, KeyboardInterrupt | SystemExit):
            self._time = -_REPEATED_S
            signal.signal(signal.SIGALRM, lambda _, frame: self._raise(int(self.received or 0), frame))
            signal.setitimer(signal.ITIMER_REAL, _DELAY_S)
        else:
            sys.__unraisablehook__(unraisable)
