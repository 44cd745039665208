"""One picture of the sound of all cameras: as the files have it, as it was, and claps to the millisecond."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bodycam_ros.drawing.picture_style import FAINT, GOOD, INK, QUIET, TYPOGRAPHY, WARNING, panel_title, side_colour
from bodycam_ros.ingest.camera_offsets import Offsets
from bodycam_ros.ingest.claps import CommonSound
from bodycam_ros.ingest.sound_peaks import ENVELOPE_S, SNIPPET_S, SNIPPET_SAMPLES, CameraSound

Array = NDArray[np.float64]

_DOTS_PER_INCH = 110
_WIDTH_INCHES, _HEAD_INCHES, _FOOT_INCHES, _ROW_INCHES = 16.0, 1.15, 0.6, 0.3
_MOST_COLUMNS = 1400
_ZOOM_MS = (-6.0, 12.0)
_HEIGHT = 0.82  # of a row that a curve may fill


def draw_timing(offsets: Offsets, path: Path, title: str = "Sound of all cameras") -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    names = sorted(offsets.times, key=lambda name: offsets.times[name].start_s)
    rows = [*names, *offsets.unplaced]
    panel = max(2.0, _ROW_INCHES * len(rows))
    height = _HEAD_INCHES + 2.0 * panel + 0.75 + _FOOT_INCHES
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=(_WIDTH_INCHES, height), facecolor="white")
        FigureCanvasAgg(figure)
        figure.text(0.02, 1.0 - 0.2 / height, title, fontsize=17.0, weight="bold", va="top")
        figure.text(0.02, 1.0 - 0.52 / height, _caption(offsets), fontsize=10.0, color=QUIET, va="top")
        upper, lower = (_FOOT_INCHES + panel + 0.75) / height, _FOOT_INCHES / height
        before = figure.add_axes((0.105, upper, 0.4, panel / height))
        after = figure.add_axes((0.105, lower, 0.4, panel / height))
        _draw_rows(before, rows, offsets, aligned=False)
        _draw_rows(after, rows, offsets, aligned=True)
        panel_title(before, "Before", "each file from its own beginning")
        panel_title(after, "After", f"in the time of {offsets.reference}")
        _draw_ends(figure, offsets, names, (upper, lower, panel / height))
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _caption(offsets: Offsets) -> str:
    claps, sounds = len(offsets.claps), len(offsets.sounds)
    caption = f"cameras: {len(offsets.times)}, claps: {claps}, other sounds that several heard: {sounds - claps}"
    if offsets.unplaced:
        caption += f", not placed: {', '.join(offsets.unplaced)}"
    return caption


def _draw_rows(axes: Axes, rows: list[str], offsets: Offsets, aligned: bool) -> None:
    """A row per camera: how suddenly it gets louder, over time."""
    for row, name in enumerate(rows):
        sound, time = offsets.heard.get(name), offsets.times.get(name)
        if sound is None or (aligned and time is None):
            continue
        seconds, values = _shown_envelope(sound)
        if aligned and time is not None:
            seconds = time.recording_s(seconds)
        colour = side_colour(name) if name in offsets.times else WARNING
        if len(seconds):
            axes.plot(seconds[[0, -1]], [row, row], color=FAINT, linewidth=6.0, solid_capstyle="butt", zorder=1)
        axes.fill_between(seconds, row, row - _HEIGHT * values, color=colour, linewidth=0.4, zorder=2)
    if aligned:
        for clap in offsets.claps:
            axes.axvline(clap.recording_s, color=GOOD, linewidth=0.7, alpha=0.6, zorder=0)
    axes.set_ylim(len(rows) - 0.4, -1.1)
    axes.set_yticks(range(len(rows)), [name.replace("_", " ") for name in rows])
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.margins(x=0.01)
    axes.set_xlabel("time of the recording [s]" if aligned else "time since the file begins [s]", labelpad=2.0)


def _shown_envelope(sound: CameraSound) -> tuple[Array, Array]:
    """Media times (N,) [s] and the envelope (N,), its largest value 1, the greatest of each column."""
    step = max(1, -(-len(sound.envelope) // _MOST_COLUMNS))
    count = len(sound.envelope) // step
    values: Array = np.zeros(0)
    if count:
        values = sound.envelope[: count * step].reshape(count, step).max(axis=1).astype(np.float64)
    largest = float(values.max()) if count else 0.0
    seconds: Array = np.float64(sound.start_s) + np.float64(ENVELOPE_S * step) * (np.arange(count) + 0.5)
    return seconds, values / max(largest, 1e-9)


def _draw_ends(figure: Figure, offsets: Offsets, names: list[str], place: tuple[float, float, float]) -> None:
    """The first and the last clap, before what the clocks say and after."""
    claps = offsets.claps
    upper, lower, height = place
    if not claps:
        axes = figure.add_axes((0.56, lower, 0.42, height))
        axes.text(0.5, 0.5, "no clap", transform=axes.transAxes, ha="center", va="center", color=QUIET)
        axes.set_axis_off()
        return
    chosen = [claps[0], claps[-1]] if len(claps) > 1 else [claps[0]]
    for clap, bottom, which in zip(chosen, (upper, lower), ("First", "Last"), strict=False):
        axes = figure.add_axes((0.56, bottom, 0.42, height))
        _draw_clap(axes, clap, offsets, names)
        spread = 1e3 * float(np.ptp(list(clap.late_s.values())))
        title = f"{which} clap" if len(chosen) > 1 else "The clap"
        panel_title(
            axes, title, f"{clap.recording_s:.3f} s; ticks: when it was heard, {spread:.1f} ms from first to last"
        )


def _draw_clap(axes: Axes, clap: CommonSound, offsets: Offsets, names: list[str]) -> None:
    step_ms = 1e3 * SNIPPET_S / SNIPPET_SAMPLES
    for row, name in enumerate(names):
        if name not in clap.peaks:
            axes.text(_ZOOM_MS[0], row, "  did not hear it", color=QUIET, fontsize=8.0, va="center")
            continue
        peak, time = clap.peaks[name], offsets.times[name]
        begin = float(time.recording_s(np.array([peak.snippet_s]))[0])
        milliseconds = 1e3 * (begin - clap.recording_s) + step_ms * np.arange(SNIPPET_SAMPLES)
        shown = (milliseconds >= _ZOOM_MS[0]) & (milliseconds <= _ZOOM_MS[1])
        axes.plot(
            milliseconds[shown],
            row - 0.55 * _HEIGHT * peak.snippet[shown].astype(float),
            color=side_colour(name),
            linewidth=0.6,
        )
        late = 1e3 * float(time.recording_s(np.array([clap.heard_s[name]]))[0] - clap.recording_s)
        axes.plot([late, late], [row - 0.45, row + 0.45], color=INK, linewidth=1.2, zorder=3)
    axes.axvline(0.0, color=GOOD, linewidth=0.7, alpha=0.6, zorder=0)
    axes.set_xlim(*_ZOOM_MS)
    axes.set_ylim(len(names) - 0.4, -0.9)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.set_xlabel("[ms] after the time that the clocks say", labelpad=2.0)
