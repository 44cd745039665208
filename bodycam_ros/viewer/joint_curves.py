"""Curves of joint angles over the time of a recording, beside the scene."""

import numpy as np
from viser import GuiApi, uplot

from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.picture_style import INK, side_colour
from bodycam_ros.viewer.inbox import Inbox, set_value
from bodycam_ros.viewer.motion import Motion

_PANEL_PX = 330
_COLUMNS = 600  # of a curve, at most

_MEANS = {"y": "bends", "x": "sideways", "z": "twists"}
"""Rotation about an axis of the N-pose; y is to the left, x forward, z up."""

_DASHES: dict[str, tuple[float, ...]] = {"y": (), "x": (6, 3), "z": (2, 2)}
_FIRST_JOINT = "knee"


class CurvePanel:
    """Shows the curves of one joint, of both sides if it has two, and a line through them at the time shown."""

    def __init__(self, gui: GuiApi, inbox: Inbox, motion: Motion) -> None:
        rows = np.linspace(0, len(motion.stamps_ns) - 1, min(_COLUMNS, len(motion.stamps_ns))).astype(int)
        self._seconds, self._angles = motion.seconds[rows], np.degrees(motion.angles[rows])
        self._names, self._groups = motion.angle_names, joint_groups(motion.angle_names)
        self._now_s = 0.0
        panel = gui.add_panel()
        with panel.add_tab("Over time"):
            self._joint = gui.add_dropdown("joint", tuple(self._groups) or ("none",))
            if _FIRST_JOINT in self._groups:
                set_value(self._joint, _FIRST_JOINT)
            data, series = self._curves()
            self._plot = gui.add_uplot(data, series, scales={"x": uplot.Scale(time=False)}, aspect=1.0)
        panel.dock_left()
        panel.set_width(_PANEL_PX)
        inbox.on_input(self._joint, lambda _: self._draw(), "joint")

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
