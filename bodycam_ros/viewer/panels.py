"""The controls of time and of the camera's image, curves of joint angles, and the switches of what is shown."""

import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from viser import GuiSliderHandle, uplot

from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.results.colours import INK, LEFT, RIGHT, side_colour
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.scene import CONTACTS, LOST, REGISTERED, SELECTED, TOUCHING, UNKNOWN
from bodycam_ros.viewer.server import Action, LocalServer, set_value
from bodycam_ros.viewer.timeline import SOME_LOST, Timeline

_SPEEDS = {"1x": 1.0, "1/2x": 0.5, "1/4x": 0.25, "1/8x": 0.125}
_STEP_S, _DECIMALS = 0.001, 3
_LEAP = 15  # states; half a second at 30 images a second

_NO_CAMERA = "none"
_BLANK = np.full((12, 16, 3), 227, np.uint8)

_PARTS = ((LEFT, "left"), (RIGHT, "right"), (SELECTED, "selected"))
_CAMERAS = ((REGISTERED, "camera registered"), (LOST, "camera not registered"))
_TIMELINE = ((SOME_LOST, "some lost (timeline)"),)
_CONTACTS = ((TOUCHING, "a foot rests"),)
_UNKNOWN = ((UNKNOWN, "camera"),)

_HELP = "keys: space plays, ← → step, shift + ← → half a second, Home and End; A W S D Q E ↑ ↓ move the view"

# viser's page turns the view with the arrow keys, by a listener on the document: the keys below are handled by the
# element beneath it, and stopped there. A checkbox would keep the keyboard. Only markup can be added to the page.
_ARROWS_ARE_OURS = (
    '<img alt="" src="data:," style="display:none" onerror="'
    "document.documentElement.addEventListener('keydown',"
    " e => { if (e.code === 'ArrowLeft' || e.code === 'ArrowRight') e.stopPropagation() });"
    "document.addEventListener('change', e => { if (e.target.type === 'checkbox') e.target.blur() })\">"
)

_Key = Literal["space", "arrowleft", "arrowright", "home", "end"]


class TimePanel:
    """Slider, buttons and keys of the time shown, which is in seconds since the first state.

    Attributes:
        is_playing: whether time passes.
    """

    def __init__(self, server: LocalServer, motion: Motion, on_change: Action) -> None:
        self._motion, self._on_change = motion, on_change
        self._duration_s = float(motion.seconds[-1])
        self._speed, self._shown_s = 1.0, 0.0
        self.is_playing = False
        moves = self._duration_s > 0.0
        gui = server.gui
        if moves:
            slider = Timeline(server, motion, max(round(self._duration_s, _DECIMALS), _STEP_S)).slider
        with gui.add_folder("Time"):
            if not moves:  # a slider needs a length
                slider = gui.add_slider("seconds", 0.0, _STEP_S, _STEP_S, 0.0, disabled=True)
            self._slider: GuiSliderHandle[float] = slider
            self._button = gui.add_button("Play", disabled=not moves)
            speed = gui.add_dropdown("speed", tuple(_SPEEDS), disabled=not moves)
            self._loop = gui.add_checkbox("loop", True, disabled=not moves)
            self._follow = gui.add_checkbox("follow the body", True)
        server.on_input(self._slider, lambda _: on_change(), "time")
        self._button.on_click(server.when_pressed(self._play_or_pause))
        server.on_input(speed, lambda name: setattr(self, "_speed", _SPEEDS[name]))
        server.on_input(self._follow, lambda _: on_change())
        if moves:
            self._add_keys(server)

    @property
    def seconds(self) -> float:
        """The time that the slider shows."""
        return float(self._slider.value)

    @property
    def follows(self) -> bool:
        """Whether the view follows the body."""
        return bool(self._follow.value)

    def advance(self) -> None:
        """Show the time that playing has reached; at the end it starts again, or stops."""
        now = time.monotonic()
        seconds, self._shown_s = self.seconds + (now - self._shown_s) * self._speed, now
        if seconds > self._duration_s and self._loop.value:
            seconds = 0.0
        if seconds > self._duration_s:
            self._play(False)
        self._show(seconds)

    def _show(self, seconds: float) -> None:
        set_value(self._slider, min(round(seconds, _DECIMALS), self._slider.max))
        self._on_change()

    def _play_or_pause(self) -> None:
        self._play(not self.is_playing)
        if self.is_playing and self.seconds >= self._slider.max:
            set_value(self._slider, 0.0)

    def _play(self, is_playing: bool) -> None:
        self.is_playing, self._shown_s = is_playing, time.monotonic()
        self._button.label = "Pause" if is_playing else "Play"

    def _pause_at(self, seconds: float) -> None:
        self._play(False)
        self._show(seconds)

    def _step(self, states: int) -> None:
        row = np.clip(self._motion.state_at(self.seconds) + states, 0, len(self._motion.stamps_ns) - 1)
        self._pause_at(float(self._motion.seconds[row]))

    def _add_keys(self, server: LocalServer) -> None:
        gui = server.gui
        gui.add_html(f'{_ARROWS_ARE_OURS}<div style="font-size:0.75em;padding:0.1em 0.9em 0.7em">{_HELP}</div>')
        keys: tuple[tuple[str, _Key, bool, Action], ...] = (
            ("play or pause", "space", False, self._play_or_pause),
            ("one frame forward", "arrowright", False, lambda: self._step(1)),
            ("one frame back", "arrowleft", False, lambda: self._step(-1)),
            ("half a second forward", "arrowright", True, lambda: self._step(_LEAP)),
            ("half a second back", "arrowleft", True, lambda: self._step(-_LEAP)),
            ("to the start", "home", False, lambda: self._pause_at(0.0)),
            ("to the end", "end", False, lambda: self._pause_at(self._duration_s)),
        )
        for label, key, shift, act in keys:
            command = gui.add_command(label, hotkey=key, modifier="shift" if shift else None)
            command.on_trigger(server.when_pressed(act))


class PicturePanel:
    """A list of cameras, and the image of the chosen one."""

    def __init__(self, server: LocalServer, cameras: Iterable[str], on_choice: Callable[[str | None], None]) -> None:
        gui = server.gui
        with gui.add_folder("Image"):
            self._camera = gui.add_dropdown("camera", (_NO_CAMERA, *cameras))
            self._image = gui.add_image(_BLANK, format="jpeg", visible=False)
            self._remark = gui.add_markdown("")
        server.on_input(self._camera, lambda name: on_choice(None if name == _NO_CAMERA else name), "camera")

    def choose(self, camera: str | None) -> None:
        """Show which camera is chosen."""
        set_value(self._camera, _NO_CAMERA if camera is None else camera)

    def show(self, pixels: NDArray[np.uint8] | None, remark: str) -> None:
        """Show an image (H, W, 3), or none, and a remark on it."""
        if pixels is not None:
            self._image.image = pixels
        self._image.visible = pixels is not None
        self._remark.content = remark


def add_switches(
    server: LocalServer,
    layers: Mapping[str, bool],
    switch: Callable[[str, bool], None],
    *,
    has_registrations: bool,
) -> None:
    """Add a checkbox for each layer (its name, and whether it is shown), and a legend."""
    rows = [_PARTS, *([_CAMERAS, _TIMELINE] if has_registrations else [_UNKNOWN])]
    if CONTACTS in layers:
        rows[-1] += _CONTACTS
    with server.gui.add_folder("Show"):
        for layer, visible in layers.items():
            server.on_input(server.gui.add_checkbox(layer, visible), partial(switch, layer))
        server.gui.add_html(_legend(*rows))


def _legend(*rows: tuple[tuple[str, str], ...]) -> str:
    square = '<span style="display:inline-block;width:0.8em;height:0.8em;border-radius:0.2em;background:{}"></span> {}'
    lines = ("&ensp; ".join(square.format(colour, text) for colour, text in row) for row in rows)
    return f'<div style="font-size:0.75em;padding:0.1em 0.9em 0.5em;line-height:1.6">{"<br>".join(lines)}</div>'


_PANEL_PX, _ASPECT = 330, 1.7
_COLUMNS = 600  # of a curve, at most

_MEANS = {"y": "bends", "x": "sideways", "z": "twists"}
"""Rotation about an axis of the N-pose; y is to the left, x forward, z up."""

_DASHES: dict[str, tuple[float, ...]] = {"y": (), "x": (6, 3), "z": (2, 2)}
_FIRST_JOINT = "knee"


class CurvePanel:
    """Shows the curves of one joint, of both sides if it has two, and a line through them at the time shown.

    Attributes:
        panel: at the left edge of the page.
    """

    def __init__(self, server: LocalServer, motion: Motion) -> None:
        rows = np.linspace(0, len(motion.stamps_ns) - 1, min(_COLUMNS, len(motion.stamps_ns))).astype(int)
        self._seconds, self._angles = motion.seconds[rows], np.degrees(motion.angles[rows])
        self._names, self._groups = motion.angle_names, joint_groups(motion.angle_names)
        self._now_s = 0.0
        gui = server.gui
        self.panel = gui.add_panel()
        with self.panel.add_tab("Over time"):
            self._joint = gui.add_dropdown("joint", tuple(self._groups) or ("none",))
            if _FIRST_JOINT in self._groups:
                set_value(self._joint, _FIRST_JOINT)
            data, series = self._curves()
            self._plot = gui.add_uplot(data, series, scales={"x": uplot.Scale(time=False)}, aspect=_ASPECT)
        self.panel.dock_left()
        self.panel.set_width(_PANEL_PX)
        server.on_input(self._joint, lambda _: self._draw(), "joint")

    def show(self, seconds: float) -> None:
        """Show a time."""
        self._now_s = min(seconds, float(self._seconds[-1]))
        self._plot.data = self._curves()[0]

    def _draw(self) -> None:
        self._plot.data, self._plot.series = self._curves()

    def _curves(self) -> tuple[tuple[np.ndarray, ...], tuple[uplot.Series, ...]]:
        """Seconds, angles [deg] and a line that is up at the time shown, each with its style."""
        names = self._groups.get(self._joint.value, [])
        seconds = np.sort(np.concatenate([self._seconds, np.full(3, self._now_s)]))
        angles = [np.interp(seconds, self._seconds, self._angles[:, self._names.index(name)]) for name in names]
        line = np.full(len(seconds), min((float(each.min()) for each in angles), default=0.0))
        line[np.searchsorted(seconds, self._now_s) + 1] = max((float(each.max()) for each in angles), default=1.0)
        series = [uplot.Series(label="s")]
        for name in names:
            joint, axis = _joint_and_axis(name)
            label = f"{SegmentName(joint).side.removeprefix('_')} {_MEANS[axis]} [°]".strip()
            series.append(uplot.Series(label=label, stroke=side_colour(joint), width=1.4, dash=_DASHES[axis]))
        series.append(uplot.Series(label="time", stroke=INK, width=1.0))
        return (seconds, *angles, line), tuple(series)


def joint_groups(angle_names: tuple[str, ...]) -> dict[str, list[str]]:
    """Joint without its side -> its angles, the left one first; sliding joints are left out."""
    groups: dict[str, list[str]] = {}
    for name in angle_names:
        joint, _ = _joint_and_axis(name)
        if not joint.endswith("_at"):
            groups.setdefault(SegmentName(joint).kind.replace("_", " "), []).append(name)
    return groups


def _joint_and_axis(angle_name: str) -> tuple[str, str]:
    """The joint of an angle, and the axis that the angles of a ball joint end in; a hinge bends."""
    joint, _, axis = angle_name.rpartition("_")
    return (joint, axis) if axis in _MEANS else (angle_name, "y")
