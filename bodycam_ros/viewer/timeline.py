"""A timeline over the whole width of the page: a slider, and beneath it spans of time of cameras and contacts.

viser has no bar along the lower edge of its page, and sizes floating panels in pixels. A style sheet in the page puts
the panel there: the rest of the page ends above it.
"""

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from viser import GuiSliderHandle

from bodycam_ros.files.shown import printable
from bodycam_ros.results.body_motion import distance_in_time
from bodycam_ros.results.colours import EQUIPMENT, FAINT, side_colour
from bodycam_ros.results.solved_body import GAP_FRAMES
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.scene import LOST, REGISTERED
from bodycam_ros.viewer.server import LocalServer

SOME_LOST = "#d9b13b"
"""Time at which a camera is registered, and another one is not."""

_COLUMNS = 800  # of a row, at most
_WORSE = {"": -1, SOME_LOST: 1, LOST: 2}
"""Rank of a colour among those of one column, which has the first of the highest rank; 0 of all others."""

_ROW_PX, _SLIDER_PX, _MOST_ROWS = 15, 92, 8  # more rows are scrolled to
_STEP_S = 0.001
_TOUCHING = 1e-9  # spans that are no further apart are one

# The label in front of a slider, and the number behind it, are as wide in viser 1.1.
_ROW = (
    '<div style="display:flex;align-items:center;height:{height}px;padding:0 0.75em">'
    '<span style="width:7.25em;flex-shrink:0;font-size:1em"><span style="font-size:0.75em;white-space:nowrap">'
    "{name}</span></span>"
    '<svg viewBox="0 0 1 1" preserveAspectRatio="none" style="flex-grow:1;width:0;height:9px;background:{empty}">'
    '{spans}</svg><span style="width:3.6rem;flex-shrink:0"></span></div>'
)
_PAGE_STYLE = """<style class="bodycam-timeline">
[data-floating-window]:has(.bodycam-timeline) {{
  position: fixed !important; left: 0 !important; top: auto !important; bottom: 0 !important;
  width: 100vw !important; height: {height}px !important;
}}
#root:has(.bodycam-timeline) > * {{ height: calc(100% - {height}px) !important; }}
</style>"""


class Row(NamedTuple):
    """A row of the timeline over T states.

    Attributes:
        name: shown in front of it.
        colours: (T,) strings ``#rrggbb``; empty where nothing is drawn.
    """

    name: str
    colours: NDArray[np.str_]


class Timeline:
    """The panel of a moving body.

    Attributes:
        slider: of the time shown, in seconds since the first state.
    """

    def __init__(self, server: LocalServer, motion: Motion, end_s: float) -> None:
        gui = server.gui
        rows = timeline_rows(motion)
        height = _SLIDER_PX + _ROW_PX * min(len(rows), _MOST_ROWS)
        panel = gui.add_panel()
        with panel.add_tab("Timeline"):
            self.slider: GuiSliderHandle[float] = gui.add_slider("seconds", 0.0, end_s, _STEP_S, 0.0)
            gui.add_html(_PAGE_STYLE.format(height=height) + rows_html(rows, motion))
        panel.float(x=0, y=-1, height=height)


def timeline_rows(motion: Motion) -> list[Row]:
    """Whether all, some or none of the cameras are registered, and when each foot or attachment touches."""
    rows = []
    if motion.registered:
        near = [distance_in_time(motion.stamps_ns, stamps) <= motion.frame_ns // 2 for stamps in _stamps(motion)]
        count = np.sum(near, axis=0)
        colours = np.where(count == len(near), REGISTERED, np.where(count == 0, LOST, SOME_LOST))
        rows.append(Row("cameras", colours))
    for contact in motion.contacts:
        colour = EQUIPMENT if contact.points_world is None else side_colour(contact.name)
        rows.append(Row(contact.name.replace("_", " "), np.where(contact.touches.any(axis=1), colour, "")))
    return rows


def _stamps(motion: Motion) -> list[NDArray[np.int64]]:
    return [stamps_ns for stamps_ns, _ in motion.registered.values()]


def rows_html(rows: Sequence[Row], motion: Motion) -> str:
    """The rows as markup; names are text in it."""
    return "".join(
        _ROW.format(
            height=_ROW_PX,
            name=escape(printable(row.name)),
            empty=FAINT,
            spans="".join(
                f'<rect x="{start:.5f}" y="0" width="{end - start:.5f}" height="1" fill="{colour}"/>'
                for start, end, colour in spans_of(row, motion)
            ),
        )
        for row in rows
    )


def spans_of(row: Row, motion: Motion) -> list[tuple[float, float, str]]:
    """Start and end, as shares of the time shown, of each span of one colour; a gap of time belongs to none.

    A column of many states has the worst of their colours: a camera that is lost in one of them is not hidden.
    """
    at = np.linspace(0, len(motion.stamps_ns) - 1, min(_COLUMNS, len(motion.stamps_ns))).astype(int)
    colours = [max(each.tolist(), key=lambda colour: _WORSE.get(colour, 0)) for each in np.split(row.colours, at[1:])]
    share = motion.seconds[at] / motion.seconds[-1]
    steps = np.diff(share)
    half = 0.5 * np.minimum(steps, GAP_FRAMES * np.median(steps))
    starts, ends = share - np.append(0.0, half), share + np.append(half, 0.0)
    spans: list[tuple[float, float, str]] = []
    for start, end, colour in zip(starts.tolist(), ends.tolist(), colours, strict=True):
        if not colour:
            continue
        if spans and spans[-1][2] == colour and start - spans[-1][1] < _TOUCHING:
            spans[-1] = (spans[-1][0], end, colour)
        else:
            spans.append((start, end, colour))
    return spans
