"""What ends a process: SIGINT, SIGTERM, SIGHUP."""

import signal
from types import FrameType


class Signals:
    """Notes what is sent to end a process, also by a terminal that is closed."""

    def __init__(self) -> None:
        self._come = False
        self._numbers = [signal.SIGINT, signal.SIGTERM]
        # nohup
        if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
            self._numbers.append(signal.SIGHUP)
        for number in self._numbers:
            signal.signal(number, self._note)

    def ignore(self) -> None:
        """From now on they do nothing."""
        for number in self._numbers:
            signal.signal(number, signal.SIG_IGN)

    def have_come(self) -> bool:
        """Whether one has come."""
        return self._come

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._come = True
