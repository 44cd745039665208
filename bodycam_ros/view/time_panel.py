"""The controls of time: a slider over the recording, play and pause, and whether the view follows the body."""

from collections.abc import Callable

from viser import GuiApi, GuiSliderHandle

from bodycam_ros.view.inbox import Inbox, on_input, set_value

_SPEEDS = {"1x": 1.0, "1/2x": 0.5, "1/4x": 0.25, "1/8x": 0.125}
_STEP_S = 0.001
_DECIMALS = 3
_PLAY, _PAUSE = "Play", "Pause"


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


class TimePanel:
    """Slider and buttons; the time that they show is in seconds since the first instant."""

    def __init__(
        self,
        gui: GuiApi,
        inbox: Inbox,
        playback: Playback,
        duration_s: float,
        on_time: Callable[[], None],
        on_follow: Callable[[], None],
    ) -> None:
        self._playback = playback
        moves = duration_s > 0.0
        with gui.add_folder("Time"):
            # A slider needs a length; that of a single instant cannot be moved.
            self._slider: GuiSliderHandle[float] = gui.add_slider(
                "seconds", 0.0, max(round(duration_s, _DECIMALS), _STEP_S), _STEP_S, 0.0, disabled=not moves
            )
            self._button = gui.add_button(_PLAY, disabled=not moves)
            speed = gui.add_dropdown("speed", tuple(_SPEEDS), disabled=not moves)
            self._follow = gui.add_checkbox("follow the body", True)

        on_input(self._slider, lambda: inbox.put(on_time, "time"))
        self._button.on_click(lambda _: inbox.put(self._play_or_pause))
        on_input(speed, lambda: inbox.put(lambda: playback.change_speed(_SPEEDS[speed.value])))
        on_input(self._follow, lambda: inbox.put(on_follow))

    @property
    def seconds(self) -> float:
        """The time that the slider shows."""
        return float(self._slider.value)

    @property
    def follows(self) -> bool:
        """Whether the view goes with the body."""
        return bool(self._follow.value)

    def show(self, seconds: float) -> None:
        """Move the slider to a time."""
        set_value(self._slider, min(round(seconds, _DECIMALS), self._slider.max))

    def _play_or_pause(self) -> None:
        if self._playback.is_playing:
            self._playback.pause()
        else:
            self._playback.play()
        self._button.label = _PAUSE if self._playback.is_playing else _PLAY
