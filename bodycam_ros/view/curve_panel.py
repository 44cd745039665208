"""A panel beside the scene: joint angles and what cameras knew over time, with a line where the time is."""

import numpy as np
from viser import GuiApi

from bodycam_ros.drawing.picture_style import side_colour
from bodycam_ros.view.camera_bands import Bands
from bodycam_ros.view.inbox import Inbox, on_input, set_value
from bodycam_ros.view.motion import Motion
from bodycam_ros.view.other_motion import OtherMotion
from bodycam_ros.view.timeline import Curve, band_rows, cursor, curve_rows, height_of

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
