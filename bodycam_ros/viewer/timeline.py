"""Curves of joint angles and bands of cameras' registrations over the time of a recording, as markup for the page."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.messages.timing import TIMING, TIMING_TYPE
from bodycam_ros.picture_style import FAINT, GOOD, INK, QUIET, RELATIVE, ROTATION_ONLY, WARNING
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.registration.landmark_matches import CameraSight
from bodycam_ros.results.camera_record import CameraLog
from bodycam_ros.results.topics import LANDMARKS, LANDMARKS_TYPE, camera_topics, wrong_message_named

SIGHT_COLOURS = {
    CameraSight.REGISTERED: GOOD,
    CameraSight.RELATIVE: RELATIVE,
    CameraSight.ROTATION_ONLY: ROTATION_ONLY,
    CameraSight.BLIND: WARNING,
}
"""Those of ``bodycam evaluate``."""

LABELS_PX, EDGE_PX = 96, 10
"""Left and right of everything that has time for its axis."""

_WIDE = 1000.0  # of a curve, in units of its own; the page stretches it
_CURVE_PX, _BAND_PX, _GAP_PX, _LEGEND_PX = 64, 11, 6, 14
_COLUMNS = 300  # of a curve, which keeps the least and the greatest value of each, and of a band
_NO_IMAGE = -1
_ROOM = 0.06  # above and below a curve
_LEAST_DEG = 10.0  # that a curve is high

Bands = Mapping[str, tuple[Array, NDArray[np.int8]]]
"""Camera -> seconds (K,) of its images since the first state, and a ``CameraSight`` for each."""


def read_bands(solved: Path, first_ns: int, cameras: Sequence[str]) -> Bands:
    """The registrations of the cameras of a solved bag.

    Args:
        solved: the bag.
        first_ns: time that seconds are counted from [ns].
        cameras: in the order that is wanted; others come after them.

    Raises:
        RecordingError: the bag or a message is damaged.
    """
    logs: dict[str, CameraLog] = defaultdict(CameraLog)
    with BagFile(solved) as bag:
        topics = camera_topics(bag, LANDMARKS, LANDMARKS_TYPE) | camera_topics(bag, TIMING, TIMING_TYPE)
        for topic, _, message in bag.messages(topics):
            with wrong_message_named(solved, topic):
                logs[topics[topic]].add(topic, message, topics[topic])
    named = [*(camera for camera in cameras if camera in logs), *sorted(set(logs) - set(cameras))]
    records = [logs[camera].record(camera) for camera in named if logs[camera].landmarks]
    return {each.camera: (np.asarray((each.stamps_ns - first_ns) * 1e-9, np.float64), each.sights) for each in records}


@dataclass(frozen=True, eq=False)
class Curve:
    """One angle over time.

    Attributes:
        seconds: (T,) [s].
        degrees: (T,) [deg].
        colour: ``#rrggbb``.
        is_other: whether it is of the recording that is compared with, and dashed.
    """

    seconds: Array
    degrees: Array
    colour: str
    is_other: bool = False


def curve_rows(rows: Mapping[str, Sequence[Curve]], duration_s: float) -> str:
    """A row for each name, with its curves on one scale [deg]."""
    return "".join(_curve_row(name, curves, duration_s) for name, curves in rows.items())


def band_rows(bands: Bands, duration_s: float) -> str:
    """A row for each camera, and a legend."""
    rows = "".join(_band_row(camera, *band, duration_s) for camera, band in bands.items())
    present = sorted({int(sight) for _, sights in bands.values() for sight in np.unique(sights)})
    legend = "".join(
        f'<span style="color:{SIGHT_COLOURS[CameraSight(sight)]}">&#9632;</span> {CameraSight(sight).label}&#8194;'
        for sight in present
    )
    return rows + _row("", f'<div style="font-size:0.7em">{legend}</div>', _LEGEND_PX)


def cursor(share: float, curves: int, bands: int) -> str:
    """A line at a share of the time through so many curves and bands above it."""
    height_px = curves * (_CURVE_PX + _GAP_PX) + bands * (_BAND_PX + _GAP_PX) + bool(bands) * (_LEGEND_PX + _GAP_PX)
    left = f"calc({LABELS_PX}px + (100% - {LABELS_PX + EDGE_PX}px) * {share:.4f})"
    return (
        f'<div style="position:relative;height:0"><div style="position:absolute;left:{left};bottom:0;width:1px;'
        f'height:{height_px}px;background:{INK};pointer-events:none"></div></div>'
    )


def _curve_row(name: str, curves: Sequence[Curve], duration_s: float) -> str:
    low = min((float(np.nanmin(curve.degrees)) for curve in curves), default=0.0)
    high = max((float(np.nanmax(curve.degrees)) for curve in curves), default=0.0)
    widen = max(0.0, _LEAST_DEG - (high - low)) / 2.0
    low, high = low - widen, high + widen
    scale = _CURVE_PX * (1.0 - 2.0 * _ROOM) / (high - low)
    top = _CURVE_PX * _ROOM + high * scale
    lines = []
    if low < 0.0 < high:
        lines.append(f'<path d="M0 {top:.1f}H{_WIDE:g}" stroke="#b9c1c8" vector-effect="non-scaling-stroke"/>')
    for curve in curves:
        x, y = _thinned(curve.seconds / max(duration_s, 1e-9) * _WIDE, curve.degrees)
        points = " ".join(f"{a:.1f},{top - b * scale:.1f}" for a, b in zip(x, y, strict=True))
        dashes = ' stroke-dasharray="4 3"' if curve.is_other else ""
        lines.append(
            f'<polyline points="{points}" fill="none" stroke="{curve.colour}" stroke-width="1.4"{dashes} '
            'vector-effect="non-scaling-stroke"/>'
        )
    drawn = (
        f'<svg viewBox="0 0 {_WIDE:g} {_CURVE_PX}" preserveAspectRatio="none" style="display:block;width:100%;'
        f'height:{_CURVE_PX}px;background:{FAINT}55">{"".join(lines)}</svg>'
    )
    return _row(f'{escape(name)}<div style="color:{QUIET}">{low:.0f} to {high:.0f}°</div>', drawn, _CURVE_PX)


def _thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """A curve of at most so many columns: of each the least and the greatest value, in their order."""
    known = np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) <= 2 * _COLUMNS:
        return x, y
    kept = []
    for rows in np.array_split(np.arange(len(x)), _COLUMNS):
        kept += sorted({int(rows[np.argmin(y[rows])]), int(rows[np.argmax(y[rows])])})
    return x[kept], y[kept]


def _band_row(camera: str, seconds: Array, sights: NDArray[np.int8], duration_s: float) -> str:
    """Of images that share a column the worst shows; an image lasts until the next one."""
    columns = np.full(_COLUMNS, _NO_IMAGE, np.int8)
    frame = float(np.median(np.diff(seconds))) if len(seconds) > 1 else 0.0
    per_second = _COLUMNS / max(duration_s + frame, 1e-9)
    first = np.maximum((seconds * per_second).astype(int), 0)
    last = np.maximum(np.ceil((seconds + frame) * per_second).astype(int), first + 1)
    for start, end, sight in zip(first, last, sights, strict=True):
        columns[start:end] = np.maximum(columns[start:end], sight)
    edges = [0, *(np.flatnonzero(np.diff(columns)) + 1).tolist(), _COLUMNS]
    parts = [
        f'<div style="position:absolute;left:{100 * start / _COLUMNS:.2f}%;width:{100 * (end - start) / _COLUMNS:.2f}%;'
        f'height:100%;background:{SIGHT_COLOURS[CameraSight(int(columns[start]))]}"></div>'
        for start, end in pairwise(edges)
        if columns[start] != _NO_IMAGE
    ]
    band = f'<div style="position:relative;height:{_BAND_PX}px;background:{FAINT}">{"".join(parts)}</div>'
    return _row(escape(camera.replace("_", " ")), band, _BAND_PX)


def _row(label: str, content: str, height_px: int) -> str:
    return (
        f'<div style="display:flex;align-items:center;height:{height_px}px;margin-bottom:{_GAP_PX}px">'
        f'<div style="flex:0 0 {LABELS_PX - 8}px;margin-right:8px;font-size:0.7em;line-height:1.1;text-align:right;'
        f'overflow-wrap:anywhere">{label}</div>'
        f'<div style="flex:1;min-width:0;margin-right:{EDGE_PX}px">{content}</div></div>'
    )
