"""The clock of a recording that is being played."""

from collections.abc import Callable


class Playback:
    """Where playing is, in seconds of the recording; it begins again at the end."""

    def __init__(self, duration_s: float, now: Callable[[], float]) -> None:
        self._speed = 1.0
        self._duration_s = duration_s
        self._now = now
        self._since: float | None = None

    @property
    def is_playing(self) -> bool:
        """Whether time goes on."""
        return self._since is not None

    def play(self) -> None:
        """Let time go on from now."""
        self._since = self._now()

    def pause(self) -> None:
        """Hold time."""
        self._since = None

    def change_speed(self, speed: float) -> None:
        """Let so many seconds of the recording pass in a second."""
        self._speed = speed

    def advance(self, seconds: float) -> float:
        """The time to show after the time shown last, in seconds since the first instant."""
        if self._since is None or self._duration_s <= 0.0:
            return seconds
        now = self._now()
        seconds += (now - self._since) * self._speed
        self._since = now
        return seconds if seconds <= self._duration_s else 0.0
