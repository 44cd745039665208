"""The controls: of time, of a correction, and of what is shown, with what the colours mean."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from viser import GuiApi, GuiSliderHandle

from bodycam_ros.plots.picture_style import LEFT, RIGHT, side_colour
from bodycam_ros.viewer.camera_scene import Bands
from bodycam_ros.viewer.correction import NO_MOVE, Move, Part
from bodycam_ros.viewer.inbox import Action, Inbox, on_input, set_value
from bodycam_ros.viewer.other_motion import OtherMotion
from bodycam_ros.viewer.scene_nodes import LOST, REGISTERED, SELECTED, UNKNOWN
from bodycam_ros.viewer.timeline import Curve, Motion, band_rows, cursor, curve_rows, height_of

_SPEEDS = {"1x": 1.0, "1/2x": 0.5, "1/4x": 0.25, "1/8x": 0.125}
_STEP_S = 0.001
_DECIMALS = 3
_PLAY, _PAUSE = "Play", "Pause"

NOTHING = "nothing"
"""What the list of parts says when no part is selected."""

_UNDO, _RESET = "last step", "this part"
_STEP_MM, _STEP_DEG = 0.1, 0.01

_PARTS = ((LEFT, "left"), (RIGHT, "right"), (SELECTED, "selected"))
_CAMERAS = ((REGISTERED, "camera registered"), (LOST, "camera lost"))
_UNKNOWN = ((UNKNOWN, "camera"),)


class Playback:
    """Where playing is, in seconds of the recording; at the end it begins again, or stops if it is told to."""

    def __init__(self, duration_s: float, now: Callable[[], float]) -> None:
        self._speed = 1.0
        self._duration_s = duration_s
        self._now = now
        self._since: float | None = None
        self.loops = True

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
        if seconds <= self._duration_s:
            return seconds
        if self.loops:
            return 0.0
        self.pause()
        return self._duration_s


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
            loop = gui.add_checkbox("loop", True, disabled=not moves)
            self._follow = gui.add_checkbox("follow the body", True)

        on_input(self._slider, lambda: inbox.put(on_time, "time"))
        self._button.on_click(lambda _: inbox.put(self.play_or_pause))
        on_input(speed, lambda: inbox.put(lambda: playback.change_speed(_SPEEDS[speed.value])))
        on_input(loop, lambda: inbox.put(lambda: setattr(playback, "loops", bool(loop.value))))
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
        self._label()

    def play_or_pause(self) -> None:
        """Let time go on, or hold it; at the end it begins again."""
        if self._playback.is_playing:
            self._playback.pause()
        else:
            self._playback.play()
            if self.seconds >= self._slider.max:
                set_value(self._slider, 0.0)
        self._label()

    def _label(self) -> None:
        label = _PAUSE if self._playback.is_playing else _PLAY
        if self._button.label != label:
            self._button.label = label


@dataclass(frozen=True)
class CorrectionActions:
    """What to do when a person uses the panel."""

    select: Callable[[Part | None], None]
    move: Callable[[Move], None]
    undo: Callable[[], None]
    reset: Callable[[], None]
    write: Callable[[], None]


class CorrectionPanel:
    """Shows and takes the correction of one selected part."""

    def __init__(
        self, gui: GuiApi, inbox: Inbox, parts: Iterable[Part], file_name: str, actions: CorrectionActions
    ) -> None:
        self._parts = {str(part): part for part in parts}
        with gui.add_folder("Correct"):
            self._part = gui.add_dropdown(
                "move", (NOTHING, *self._parts), hint="or click a camera or a joint in the scene, and drag its arrows"
            )
            self._shift = gui.add_vector3(
                "moved [mm]", (0.0, 0.0, 0.0), step=_STEP_MM, hint="along the segment's axes: forward, left, up"
            )
            self._turn = gui.add_vector3(
                "turned [deg]", (0.0, 0.0, 0.0), step=_STEP_DEG, hint="about the segment's axes: forward, left, up"
            )
            back = gui.add_button_group("take back", (_UNDO, _RESET))
            self._write = gui.add_button(f"Write {file_name}")
            self._moved = gui.add_markdown("")

        on_input(self._part, lambda: inbox.put(partial(actions.select, self._parts.get(self._part.value))))
        for field in (self._shift, self._turn):
            on_input(field, lambda: inbox.put(partial(actions.move, self._entered())))
        back.on_click(lambda event: inbox.put(actions.undo if event.target.value == _UNDO else actions.reset))
        self._write.on_click(lambda _: inbox.put(actions.write))

    def select(self, part: Part | None) -> None:
        """Show another part as the one to be moved."""
        set_value(self._part, NOTHING if part is None else str(part))

    def show(self, move: Move | None, moves: Iterable[tuple[Part, Move]], *, can_turn: bool) -> None:
        """Show how far the selected part (None: no part) and all others are from where the file has them."""
        shown = (NO_MOVE if move is None else move).rounded()
        for field, values in ((self._shift, shown.shift_mm), (self._turn, shown.turn_deg)):
            x, y, z = values.tolist()
            set_value(field, (x, y, z))
        self._shift.disabled = move is None
        self._turn.disabled = not can_turn
        lines = [f"{part}: {moved}" for part, moved in moves]
        self._moved.content = "\n\n".join(["**not written yet**", *lines]) if lines else ""
        self._write.disabled = not lines

    def _entered(self) -> Move:
        return Move(np.array(self._shift.value, dtype=np.float64), np.array(self._turn.value, dtype=np.float64))


class ShowPanel:
    """A legend, and a switch for each kind of thing; what is hidden at first is switched on later."""

    def __init__(
        self,
        gui: GuiApi,
        inbox: Inbox,
        switches: Mapping[str, Callable[[bool], None]],
        hidden: Collection[str] = (),
        *,
        knows_registration: bool,
    ) -> None:
        with gui.add_folder("Show"):
            for label, switch in switches.items():
                self._add_switch(gui, inbox, label, switch, label not in hidden)
            gui.add_html(_legend(_PARTS, _CAMERAS if knows_registration else _UNKNOWN))

    def _add_switch(self, gui: GuiApi, inbox: Inbox, label: str, switch: Callable[[bool], None], is_on: bool) -> None:
        box = gui.add_checkbox(label, is_on)
        on_input(box, lambda: inbox.put(lambda: switch(bool(box.value))))


def _legend(*rows: tuple[tuple[str, str], ...]) -> str:
    square = '<span style="display:inline-block;width:0.8em;height:0.8em;border-radius:0.2em;background:{}"></span> {}'
    lines = ("&ensp; ".join(square.format(colour, text) for colour, text in row) for row in rows)
    return f'<div style="font-size:0.75em;padding:0.1em 0.9em 0.5em;line-height:1.6">{"<br>".join(lines)}</div>'


_WIDTH_PX = 330
_SIDES = ("_left", "_right")
_MEANS = {"y": "bends", "x": "sideways", "z": "twists"}
"""What a turn about an axis of the N-pose does: y is to the left, x forward, z up."""

_FIRST = "knee"
"""What is shown at first, where a body has it: nothing tells walking more quickly."""


class CurvePanel:
    """Shows the curves of one joint, of both sides if it has two, and the bands of all cameras."""

    def __init__(self, gui: GuiApi, inbox: Inbox, motion: Motion, other: OtherMotion | None) -> None:
        self._motion, self._other = motion, other
        self._duration_s = float(motion.seconds[-1])
        self._bands: Bands = {}
        self._rows = 0
        groups = joint_groups(motion.angle_names)
        panel = gui.add_panel()
        with panel.add_tab("Over time"):
            self._joint = gui.add_dropdown("joint", tuple(groups) or ("none",))
            if _FIRST in groups:
                set_value(self._joint, _FIRST)
            self._drawn = gui.add_html("")
            self._cursor = gui.add_html("")
            self._remark = gui.add_markdown("")
        self._groups = groups
        panel.dock_left()
        panel.set_width(_WIDTH_PX)
        on_input(self._joint, lambda: inbox.put(self._draw, "joint"))
        self._draw()

    def show_bands(self, bands: Bands) -> None:
        """Show what cameras knew."""
        self._bands = bands
        self._draw()

    def show(self, seconds: float, remark: str) -> None:
        """Show where the time is, and say something about it."""
        share = min(seconds / self._duration_s, 1.0) if self._duration_s > 0.0 else 0.0
        self._cursor.content = cursor(share, height_of(self._rows, len(self._bands)))
        if self._remark.content != remark:
            self._remark.content = remark

    def _draw(self) -> None:
        rows = {
            label: [curve for name in names for curve in self._curves(name)]
            for label, names in self._groups.get(self._joint.value, {}).items()
        }
        self._rows = len(rows)
        bands = band_rows(self._bands, self._duration_s) if self._bands else ""
        self._drawn.content = curve_rows(rows, self._duration_s) + bands

    def _curves(self, name: str) -> list[Curve]:
        """The curve of an angle, beneath it that of the other recording."""
        colour = side_colour(_joint_of(name))
        column = self._motion.angle_names.index(name)
        curves = [Curve(self._motion.seconds, np.degrees(self._motion.angles[:, column]), colour)]
        if self._other is not None and name in self._other.angles:
            seconds = np.asarray((self._other.stamps_ns - self._motion.stamps_ns[0]) * 1e-9, np.float64)
            curves.insert(0, Curve(seconds, np.degrees(self._other.angles[name]), colour, is_other=True))
        return curves


def joint_groups(angle_names: tuple[str, ...]) -> dict[str, dict[str, list[str]]]:
    """Joint without its side -> how it turns -> names of the angles, the left one first; places are left out."""
    groups: dict[str, dict[str, list[str]]] = {}
    for name in angle_names:
        joint = _joint_of(name)
        if joint.endswith("_at"):
            continue
        axis = name.removeprefix(joint).removeprefix("_")
        both = joint
        for side in _SIDES:
            both = both.removesuffix(side)
        label = f"{_MEANS[axis]} ({axis})" if axis else "bends"
        groups.setdefault(both.replace("_", " "), {}).setdefault(label, []).append(name)
    return groups


def _joint_of(angle_name: str) -> str:
    """The joint of an angle: a ball's end with an axis."""
    joint, _, axis = angle_name.rpartition("_")
    return joint if axis in _MEANS else angle_name


_LEAP = 15  # instants; half a second at 30 images a second

HELP = "keys: space plays, ← → step, shift + ← → leap, Home and End; A W S D Q E ↑ ↓ move the view"

_Key = Literal["space", "arrowleft", "arrowright", "home", "end"]

# The page turns the view with the arrows to the sides, too. Its listener is on the document, that of our keys on the
# element below: what is stopped there reaches ours alone. A box that was ticked would keep the keyboard to itself.
# Markup is all that a page of viser takes over.
_ARROWS_ARE_OURS = (
    '<img alt="" src="data:," style="display:none" onerror="'
    "document.documentElement.addEventListener('keydown',"
    " e => { if (e.code === 'ArrowLeft' || e.code === 'ArrowRight') e.stopPropagation() });"
    "document.addEventListener('change', e => { if (e.target.type === 'checkbox') e.target.blur() })\">"
)


class Keys:
    """Listens to the keyboard while no field is being typed in."""

    def __init__(
        self,
        gui: GuiApi,
        inbox: Inbox,
        play: Action,
        step: Callable[[int], None],
        go: Callable[[float], None],
    ) -> None:
        self._gui, self._inbox = gui, inbox
        gui.add_html(f'{_ARROWS_ARE_OURS}<div style="font-size:0.75em;padding:0.1em 0.9em 0.7em">{HELP}</div>')
        self._add("play or pause", "space", play)
        self._add("an instant on", "arrowright", lambda: step(1))
        self._add("an instant back", "arrowleft", lambda: step(-1))
        self._add("half a second on", "arrowright", lambda: step(_LEAP), shift=True)
        self._add("half a second back", "arrowleft", lambda: step(-_LEAP), shift=True)
        self._add("to the start", "home", lambda: go(0.0))
        self._add("to the end", "end", lambda: go(float("inf")))

    def _add(self, label: str, key: _Key, act: Action, *, shift: bool = False) -> None:
        command = self._gui.add_command(label, hotkey=key, modifier="shift" if shift else None)

        # A coroutine, because the server runs others on several threads and out of order.
        async def pressed(_: object) -> None:
            self._inbox.put(act)

        command.on_trigger(pressed)
