"""Curves of joint angles over the time of a recording, beside the scene."""

from collections.abc import Sequence
from html import escape

import numpy as np
from viser import GuiApi

from bodycam_ros.calibration.anthropometry import SegmentName
from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import FAINT, INK, QUIET, side_colour
from bodycam_ros.viewer.inbox import Inbox, set_value
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.scene_nodes import GRID

_PANEL_PX = 330
_LABELS_PX, _EDGE_PX = 96, 10  # left and right of the curves
_WIDE = 1000.0  # of a curve, in units of its own; the page stretches it
_CURVE_PX, _GAP_PX = 64, 6
_COLUMNS = 300  # of a curve, which keeps the least and the greatest value of each
_MARGIN = 0.06  # above and below a curve, as a share of its height
_LEAST_DEG = 10.0  # range of a curve

_MEANS = {"y": "bends", "x": "sideways", "z": "twists"}
"""Rotation about an axis of the N-pose; y is to the left, x forward, z up."""

_FIRST_JOINT = "knee"


class CurvePanel:
    """Shows the curves of one joint, of both sides if it has two."""

    def __init__(self, gui: GuiApi, inbox: Inbox, motion: Motion) -> None:
        self._motion = motion
        self._duration_s = max(float(motion.seconds[-1]), 1e-9)
        self._groups = joint_groups(motion.angle_names)
        panel = gui.add_panel()
        with panel.add_tab("Over time"):
            self._joint = gui.add_dropdown("joint", tuple(self._groups) or ("none",))
            if _FIRST_JOINT in self._groups:
                set_value(self._joint, _FIRST_JOINT)
            self._curves = gui.add_html("")
            self._cursor = gui.add_html("")
        panel.dock_left()
        panel.set_width(_PANEL_PX)
        inbox.on_input(self._joint, lambda _: self._draw(), "joint")
        self._draw()

    def show(self, seconds: float) -> None:
        """Show a time, as a line through the curves above it."""
        height_px = len(self._groups.get(self._joint.value, ())) * (_CURVE_PX + _GAP_PX)
        share = min(seconds / self._duration_s, 1.0)
        left = f"calc({_LABELS_PX}px + (100% - {_LABELS_PX + _EDGE_PX}px) * {share:.4f})"
        self._cursor.content = (
            f'<div style="position:relative;height:0"><div style="position:absolute;left:{left};bottom:0;width:1px;'
            f'height:{height_px}px;background:{INK};pointer-events:none"></div></div>'
        )

    def _draw(self) -> None:
        rows = (self._row(*row) for row in self._groups.get(self._joint.value, {}).items())
        self._curves.content = "".join(rows)

    def _row(self, label: str, names: Sequence[str]) -> str:
        """The angles of some names, on one scale."""
        angles = {name: np.degrees(self._motion.angles[:, self._motion.angle_names.index(name)]) for name in names}
        low, high = (float(limit(list(angles.values()))) for limit in (np.nanmin, np.nanmax))
        widen = max(0.0, _LEAST_DEG - (high - low)) / 2.0
        low, high = low - widen, high + widen
        scale = _CURVE_PX * (1.0 - 2.0 * _MARGIN) / (high - low)
        top = _CURVE_PX * _MARGIN + high * scale
        lines = []
        if low < 0.0 < high:
            lines.append(f'<path d="M0 {top:.1f}H{_WIDE:g}" stroke="{GRID}" vector-effect="non-scaling-stroke"/>')
        for name, degrees in angles.items():
            x, y = _thinned(self._motion.seconds / self._duration_s * _WIDE, degrees)
            points = " ".join(f"{a:.1f},{top - b * scale:.1f}" for a, b in zip(x, y, strict=True))
            lines.append(
                f'<polyline points="{points}" fill="none" stroke="{side_colour(_joint_of(name))}" stroke-width="1.4" '
                'vector-effect="non-scaling-stroke"/>'
            )
        return (
            f'<div style="display:flex;align-items:center;height:{_CURVE_PX}px;margin-bottom:{_GAP_PX}px">'
            f'<div style="flex:0 0 {_LABELS_PX - 8}px;margin-right:8px;font-size:0.7em;line-height:1.1;'
            f'text-align:right">{escape(label)}<div style="color:{QUIET}">{low:.0f} to {high:.0f}°</div></div>'
            f'<div style="flex:1;min-width:0;margin-right:{_EDGE_PX}px">'
            f'<svg viewBox="0 0 {_WIDE:g} {_CURVE_PX}" preserveAspectRatio="none" style="display:block;width:100%;'
            f'height:{_CURVE_PX}px;background:{FAINT}55">{"".join(lines)}</svg></div></div>'
        )


def joint_groups(angle_names: tuple[str, ...]) -> dict[str, dict[str, list[str]]]:
    """Joint without its side -> kind of rotation -> its angles, the left one first; sliding joints are left out."""
    groups: dict[str, dict[str, list[str]]] = {}
    for name in angle_names:
        joint = _joint_of(name)
        if joint.endswith("_at"):
            continue
        axis = name.removeprefix(joint).removeprefix("_")
        label = f"{_MEANS[axis]} ({axis})" if axis else "bends"
        groups.setdefault(SegmentName(joint).kind.replace("_", " "), {}).setdefault(label, []).append(name)
    return groups


def _joint_of(angle_name: str) -> str:
    """The joint of an angle: the angles of a ball joint end in an axis."""
    joint, _, axis = angle_name.rpartition("_")
    return joint if axis in _MEANS else angle_name


def _thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """A curve of a limited number of columns: the least and the greatest value of each, in their order."""
    known = np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) <= 2 * _COLUMNS:
        return x, y
    kept: list[int] = []
    for rows in np.array_split(np.arange(len(x)), _COLUMNS):
        kept += sorted({int(rows[np.argmin(y[rows])]), int(rows[np.argmax(y[rows])])})
    return x[kept], y[kept]
