"""One picture of the sound of all cameras: as the files have it, as it was, and claps to the millisecond.

reference: waist_front           camera whose media time is the recording's
cameras:
  head:
    start_s: -2.0555             recording_s = start_s + (1 + drift_ppm / 1e6) * media_s
    start_sigma_s: 0.0013        standard deviation, the travel of sound included
    drift_ppm: 3.1
    drift_sigma_ppm: 31.0
    source: claps                claps, sound, motion, telemetry or given
    confidence: 0.49             0 to 1: lead over the second best start; 1: two sources agree
claps:
- recording_s: 3.0032            when the reference heard it, or would have
  share: 1.0                     of the cameras that ran then, which heard it
  heard_s: {head: 5.0589}        camera -> media time
  late_ms: {head: -0.31}         camera -> by how much later than its clock says; the way of the sound, and error
unplaced: {foot_left: has no sound}
remarks: []
"""

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import yaml
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.box import SIMPLE_HEAD
from rich.table import Table

from bodycam_ros.ingest.camera_offsets import Offsets
from bodycam_ros.ingest.claps import CommonSound
from bodycam_ros.ingest.sound_peaks import ENVELOPE_S, SNIPPET_S, SNIPPET_SAMPLES, CameraSound
from bodycam_ros.plots.picture_style import FAINT, GOOD, INK, QUIET, TYPOGRAPHY, WARNING, panel_title, side_colour
from bodycam_ros.whole_file import failure_named, whole_files, write_whole

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


FILE_NAME, PICTURE_NAME = "timing.yaml", "timing.png"

_PPM, _MS = 1e6, 1e3


def timing_table(offsets: Offsets) -> Table:
    """A row per camera, in the order in which they started."""
    table = Table(title="clocks of the cameras", box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("camera", overflow="fold")
    for column in ("start\n[s]", "sigma\n[ms]", "drift\n[ppm]", "sigma\n[ppm]"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("by", overflow="fold")
    table.add_column("confi-\ndence", justify="right", no_wrap=True)
    for name, time in sorted(offsets.times.items(), key=lambda item: item[1].start_s):
        if name == offsets.reference:
            table.add_row(name, "0.0000", "", "0.0", "", "reference", "")
            continue
        table.add_row(
            name,
            f"{time.start_s:+.4f}",
            f"{_MS * time.start_sigma_s:.1f}",
            f"{_PPM * time.drift:+.1f}",
            f"{_PPM * time.drift_sigma:.1f}",
            time.source,
            f"{offsets.confidence[name]:.2f}",
        )
    for name, why in offsets.unplaced.items():
        table.add_row(name, "unknown", "", "", "", why, "", style="red")
    return table


def timing_document(offsets: Offsets) -> dict[str, Any]:
    """The content of ``timing.yaml``, as described on top."""
    return {
        "reference": offsets.reference,
        "cameras": {
            name: {
                "start_s": round(time.start_s, 7),
                "start_sigma_s": round(time.start_sigma_s, 7),
                "drift_ppm": round(_PPM * time.drift, 3),
                "drift_sigma_ppm": round(_PPM * time.drift_sigma, 3),
                "source": time.source,
                "confidence": round(offsets.confidence[name], 3),
            }
            for name, time in offsets.times.items()
        },
        "claps": [
            {
                "recording_s": round(clap.recording_s, 6),
                "share": round(clap.share, 3),
                "heard_s": {name: round(heard, 6) for name, heard in clap.heard_s.items()},
                "late_ms": {name: round(_MS * late, 3) for name, late in clap.late_s.items()},
            }
            for clap in offsets.claps
        ],
        "unplaced": dict(offsets.unplaced),
        "remarks": list(offsets.remarks),
    }


def write_timing(offsets: Offsets, folder: Path) -> Path:
    """Write ``timing.yaml`` into a folder, whole or not at all; returns its path.

    Raises:
        OutputError: it cannot be written.
    """
    path = folder / FILE_NAME
    text = yaml.safe_dump(timing_document(offsets), sort_keys=False, allow_unicode=True, width=120)
    write_whole(path, f"# Clocks of the cameras: recording_s = start_s + (1 + drift_ppm / 1e6) * media_s\n{text}")
    return path


def write_timing_report(offsets: Offsets, folder: Path) -> None:
    """Write ``timing.yaml`` and ``timing.png`` into a folder, both or neither; earlier ones are replaced.

    Raises:
        OutputError: they cannot be written.
    """
    with whole_files(folder) as unfinished, failure_named(folder):
        write_timing(offsets, unfinished)
        draw_timing(offsets, unfinished / PICTURE_NAME)
