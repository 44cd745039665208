"""Table, file and picture of the clocks of all cameras.

reference: waist_front           camera whose media time is the recording's
cameras:
  head:
    start_s: -2.0555             recording_s = start_s + (1 + drift_ppm / 1e6) * media_s
    start_sigma_s: 0.0013        standard deviation, the travel of sound included
    drift_ppm: 3.1
    drift_sigma_ppm: 31.0
    source: claps                claps, sound, motion, telemetry or given
    confidence: 0.49             0 to 1: lead over the second best start; 1 of a given one
claps:
- recording_s: 3.0032            when it reached the reference
  share: 1.0                     of the cameras that ran then, which recorded it
  heard_s: {head: 5.0589}        camera -> media time
  late_ms: {head: -0.31}         camera -> by how much later than by its clock; the travel of sound, and error
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
from bodycam_ros.ingest.sound_peaks import ENVELOPE_S, SNIPPET_S, SNIPPET_SAMPLES, CameraSound
from bodycam_ros.ingest.sound_sync import CommonSound
from bodycam_ros.plots.picture_style import FAINT, GOOD, INK, QUIET, TYPOGRAPHY, panel_title, side_colour
from bodycam_ros.whole_file import failure_named, whole_files, write_whole

Array = NDArray[np.float64]

_PPM, _MS = 1e6, 1e3
_DOTS_PER_INCH = 110
_WIDTH_INCHES, _ROW_INCHES = 16.0, 0.45
_MOST_COLUMNS = 1400
_ZOOM_MS = (-6.0, 12.0)
_HEIGHT = 0.82  # of a row that a curve may fill


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


def write_timing_report(offsets: Offsets, folder: Path) -> None:
    """Write ``timing.yaml`` and ``timing.png`` into a folder, both or neither; earlier ones are replaced.

    Raises:
        OutputError: they cannot be written.
    """
    text = yaml.safe_dump(_document(offsets), sort_keys=False, allow_unicode=True, width=120)
    head = "# Clocks of the cameras: recording_s = start_s + (1 + drift_ppm / 1e6) * media_s\n"
    with whole_files(folder) as unfinished, failure_named(folder):
        write_whole(unfinished / "timing.yaml", head + text)
        _draw(offsets, unfinished / "timing.png")


def _document(offsets: Offsets) -> dict[str, Any]:
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


def _draw(offsets: Offsets, path: Path) -> None:
    """The sound of all cameras in one time, and the first and last clap to the millisecond."""
    names = sorted(offsets.times, key=lambda name: offsets.times[name].start_s)
    claps = list(dict.fromkeys((offsets.claps[0], offsets.claps[-1]))) if offsets.claps else []
    height = max(4.0, 1.6 + _ROW_INCHES * len(names))
    with matplotlib.rc_context(TYPOGRAPHY):
        figure = Figure(figsize=(_WIDTH_INCHES, height), facecolor="white", layout="constrained")
        FigureCanvasAgg(figure)
        panels: Any = figure.subplots(1, 1 + len(claps), width_ratios=[2.0] + [1.0] * len(claps), squeeze=False)[0]
        sounds, count = len(offsets.sounds), len(offsets.claps)
        panel_title(
            panels[0],
            f"In the time of {offsets.reference}",
            f"cameras: {len(names)}, claps: {count}, other common sounds: {sounds - count}",
        )
        _draw_rows(panels[0], names, offsets)
        for axes, clap in zip(panels[1:], claps, strict=True):
            _draw_clap(axes, clap, offsets, names)
        figure.savefig(path, dpi=_DOTS_PER_INCH, format="png")


def _draw_rows(axes: Axes, names: list[str], offsets: Offsets) -> None:
    """A row per camera: how suddenly it gets louder, over time."""
    for row, name in enumerate(names):
        sound = offsets.scanned.get(name)
        if sound is None:
            continue
        seconds, values = _shown_envelope(sound)
        seconds = offsets.times[name].recording_s(seconds)
        if len(seconds):
            axes.plot(seconds[[0, -1]], [row, row], color=FAINT, linewidth=6.0, solid_capstyle="butt", zorder=1)
        axes.fill_between(seconds, row, row - _HEIGHT * values, color=side_colour(name), linewidth=0.4, zorder=2)
    for clap in offsets.claps:
        axes.axvline(clap.recording_s, color=GOOD, linewidth=0.7, alpha=0.6, zorder=0)
    axes.set_ylim(len(names) - 0.4, -1.1)
    axes.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.margins(x=0.01)
    axes.set_xlabel("time of the recording [s]", labelpad=2.0)


def _shown_envelope(sound: CameraSound) -> tuple[Array, Array]:
    """Media times (N,) [s] and the envelope (N,), its largest value 1, the greatest of each column."""
    step = max(1, -(-len(sound.envelope) // _MOST_COLUMNS))
    count = len(sound.envelope) // step
    values: Array = sound.envelope[: count * step].reshape(count, step).max(axis=1, initial=0.0).astype(np.float64)
    seconds: Array = np.float64(sound.start_s) + np.float64(ENVELOPE_S * step) * (np.arange(count) + 0.5)
    return seconds, values / max(float(values.max(initial=0.0)), 1e-9)


def _draw_clap(axes: Axes, clap: CommonSound, offsets: Offsets, names: list[str]) -> None:
    """Waveforms of one clap over the time that the clocks give it."""
    step_ms = 1e3 * SNIPPET_S / SNIPPET_SAMPLES
    for row, name in enumerate(names):
        if name not in clap.peaks:
            axes.text(_ZOOM_MS[0], row, "  not recorded", color=QUIET, fontsize=8.0, va="center")
            continue
        peak, time = clap.peaks[name], offsets.times[name]
        begin = float(time.recording_s(np.array([peak.snippet_s]))[0])
        milliseconds = 1e3 * (begin - clap.recording_s) + step_ms * np.arange(SNIPPET_SAMPLES)
        shown = (milliseconds >= _ZOOM_MS[0]) & (milliseconds <= _ZOOM_MS[1])
        wave = row - 0.55 * _HEIGHT * peak.snippet[shown].astype(float)
        axes.plot(milliseconds[shown], wave, color=side_colour(name), linewidth=0.6)
        late = 1e3 * float(time.recording_s(np.array([clap.heard_s[name]]))[0] - clap.recording_s)
        axes.plot([late, late], [row - 0.45, row + 0.45], color=INK, linewidth=1.2, zorder=3)
    axes.axvline(0.0, color=GOOD, linewidth=0.7, alpha=0.6, zorder=0)
    axes.set_xlim(*_ZOOM_MS)
    axes.set_ylim(len(names) - 0.4, -0.9)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.set_xlabel("[ms] after the time by the clocks", labelpad=2.0)
    spread = 1e3 * float(np.ptp(list(clap.late_s.values())))
    panel_title(axes, f"Clap at {clap.recording_s:.3f} s", f"{spread:.1f} ms from first to last")
