"""One picture that shows at a glance whether a solved recording is any good."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Patch

from bodycam_ros.evaluate.equipment import draw_equipment
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.figure_panel import draw_figures
from bodycam_ros.evaluate.time_panels import ANGLE_PANELS, ERROR_PANELS, draw_angles, draw_errors
from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import (
    CAUTION,
    GOOD,
    INK,
    LANDMARKS,
    QUIET,
    RELATIVE,
    ROTATION_ONLY,
    WARNING,
    open_picture,
    panel_title,
    side_colour,
)
from bodycam_ros.registration.landmark_matches import CameraSight
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.verdict import Level, Verdict

_VERDICT_COLOURS = {Level.GOOD: GOOD, Level.DOUBTFUL: CAUTION, Level.WRONG: WARNING}
_MAX_LETTERS = 150
"""Of the line below the name; the report and summary.json have the rest."""

_WIDTH, _HEIGHT, _EQUIPMENT_HEIGHT = 16.0, 11.6, 2.6  # [in]
_LEFT_COLUMN, _RIGHT_COLUMN = (0.095, 0.405), (0.6, 0.365)

_MAX_COLUMNS = 900
"""Columns of the strip; of the images that share one, the worst shows."""

_NO_IMAGE = "#f7f8f9"
_COLOURS = MappingProxyType(
    {CameraSight.RELATIVE: RELATIVE, CameraSight.ROTATION_ONLY: ROTATION_ONLY, CameraSight.BLIND: WARNING}
)


def draw_summary(evaluation: Evaluation, path: Path) -> None:
    """Write the picture as PNG.

    Raises:
        OSError: the file cannot be written.
    """
    equipment = evaluation.solved.equipment
    height = _HEIGHT + (_EQUIPMENT_HEIGHT if equipment is not None else 0.0)
    with open_picture(path, _WIDTH, height) as figure:

        def add_panel(column: tuple[float, float], bottom: float, top: float, shared: Axes | None = None) -> Axes:
            """Axes between two heights, given as shares of a picture without equipment."""
            low, high = (1.0 - (1.0 - share) * _HEIGHT / height for share in (bottom, top))
            return figure.add_axes((column[0], low, column[1], high - low), sharex=shared)

        _draw_headline(figure, evaluation, height)
        draw_figures(add_panel((0.03, 0.94), 0.545, 0.88), evaluation)
        registrations = add_panel(_LEFT_COLUMN, 0.232, 0.49)
        (_draw_body_cameras if evaluation.solved.cameras else _draw_static_cameras)(registrations, evaluation.solved)
        for draw, column, (bottom, top), count in (
            (draw_errors, _LEFT_COLUMN, (0.055, 0.182), ERROR_PANELS),
            (draw_angles, _RIGHT_COLUMN, (0.055, 0.49), ANGLE_PANELS),
        ):
            gap, panels = 0.018, []
            each = (top - bottom + gap) / count
            for index in range(count):
                high = top - index * each
                panels.append(add_panel(column, high - each + gap, high, registrations))
                panels[-1].tick_params(labelbottom=index == count - 1)
            draw(panels, evaluation)
        if equipment is not None:
            panel = add_panel((0.095, 0.87), -0.16, -0.03, registrations)
            draw_equipment(panel, evaluation.solved, equipment)
        figure.align_ylabels()


def _draw_headline(figure: Figure, evaluation: Evaluation, height: float) -> None:
    """Name, duration, verdict and key figures."""
    solved = evaluation.solved
    name, below, verdict = (1.0 - inches / height for inches in (0.29, 0.66, 0.93))
    figure.text(0.03, name, solved.path.resolve().name, fontsize=17.0, weight="bold", va="top")
    what = f"{solved.duration_s:.1f} s, frames: {len(solved.stamps_ns)}, cameras: {len(solved.cameras)}"
    if solved.stations:
        what += f", static cameras: {len(solved.stations)}"
    if evaluation.comparison is not None:
        what += f", truth: {evaluation.comparison.truth_name}"
    elif evaluation.agreement is not None:
        what += f", compared with {evaluation.agreement.name}"
    figure.text(0.03, below, what, fontsize=10.0, color=QUIET, va="top")
    colour = _VERDICT_COLOURS[evaluation.verdict.level]
    figure.text(0.03, verdict, verdict_line(evaluation.verdict), fontsize=11.0, weight="bold", color=colour, va="top")
    figures = key_figures(evaluation.figures)
    for index, (value, caption) in enumerate(figures):
        across = 0.97 - 0.112 * (len(figures) - 1 - index)
        figure.text(across, name, value, fontsize=17.0, color=INK, va="top", ha="right")
        figure.text(across, below, caption, fontsize=9.0, color=QUIET, va="top", ha="right")


def verdict_line(verdict: Verdict) -> str:
    """The verdict and the likely cause of the worst finding, shortened to a line."""
    line = verdict.text
    if verdict.findings and verdict.findings[0].why:
        line += f" ({verdict.findings[0].subject}: {verdict.findings[0].why})"
    return line if len(line) <= _MAX_LETTERS else f"{line[: _MAX_LETTERS - 3]}..."


def key_figures(figures: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(value, caption) of the figures to judge by."""
    shown = [(f"{figures['image_coverage']:.1%}", "body solved"), *_camera_figures(figures)]
    if (truth := figures.get("truth")) is not None:
        return [
            *shown[:2],
            (f"{truth['position_cm']['mean']:.2f} cm", "position error, mean"),
            (f"{truth['rotation_deg']['mean']:.2f}°", "rotation error, mean"),
            (f"{100.0 * (truth['scale'] - 1.0):+.2f} %", "scale error"),
            (f"{truth['tilt_deg']:.2f}°", "tilt"),
        ]
    if (agreement := figures.get("agreement")) is not None:
        return [*shown, (f"{agreement['position_cm']['mean']:.2f} cm", "position difference, mean")]
    sigma, jitter = (figures[name]["median"] for name in ("root_position_sigma_mm", "jitter_mm"))
    known = ((sigma, "root sigma, median"), (jitter, "jitter, median"))
    return [*shown, *((f"{value:.1f} mm" if value is not None else "unknown", caption) for value, caption in known)]


def _camera_figures(figures: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Shares of images: registered by body cameras; without any, observed by static ones."""
    cameras = [*figures["cameras"].values(), *figures.get("stations", {}).values()]
    images = [camera["images"] for camera in cameras]
    if not figures["cameras"]:
        observed, segments = (np.average([c[k] for c in cameras], weights=images) for k in ("seen", "segments"))
        return [(f"{observed:.1%}", "body observed"), (f"{segments:.1f}", "segments per image")]
    worn = list(figures["cameras"].values())
    registered = np.average([camera["registered"] for camera in worn], weights=images[: len(worn)])
    counts = [camera["landmarks"] for camera in worn if camera["landmarks"] is not None]  # unknown in a slim bag
    landmarks = [(f"{np.mean(counts):.0f}", "landmarks per image")] if counts else []
    return [(f"{registered:.1%}", "cameras registered"), *landmarks]


def _draw_static_cameras(axes: Axes, solved: SolvedRecording) -> None:
    """A row per static camera, darker with more segments, red without any."""
    records = solved.stations
    segments = _strip(solved, records, lambda record: record.segments, np.fmin, _MAX_COLUMNS)
    most = float(np.nanmax(segments, initial=1.0))
    layers = [(segments, segments > 0.0, LANDMARKS, most), (segments, segments == 0.0, ListedColormap([WARNING]), 1.0)]
    names, shares = [record.station for record in records], [float(record.observes.mean()) for record in records]
    _draw_strips(axes, solved, layers, names, shares)
    panel_title(axes, "Static cameras", f"segments that each observes, dark: {most:.0f}; red: none")


def _draw_body_cameras(axes: Axes, solved: SolvedRecording) -> None:
    """A row per camera, darker with more landmarks; other colours where it is not registered in the map."""
    landmarks, sights = sight_table(solved, _MAX_COLUMNS)
    known = landmarks[np.isfinite(landmarks)]
    top = float(np.percentile(known, 98)) if known.size else 1.0
    top = max(10.0, 10.0 * np.ceil(top / 10.0))
    layers: list[tuple[Array, Any, Colormap, float]] = [(landmarks, sights == CameraSight.REGISTERED, LANDMARKS, top)]
    layers += [(sights, sights == sight, ListedColormap([colour]), 1.0) for sight, colour in _COLOURS.items()]
    names, shares = zip(*((each.camera, float(each.registered.mean())) for each in solved.cameras), strict=True)
    image = _draw_strips(axes, solved, layers, names, shares)
    for label, name in zip(axes.get_yticklabels(), names, strict=True):
        label.set_color(side_colour(name))
    panel_title(axes, "Camera registration", "landmarks per image")
    bar = axes.inset_axes((0.46, 1.025, 0.14, 0.022))
    colours = axes.figure.colorbar(image, cax=bar, orientation="horizontal", ticks=[0.0, top])
    colours.outline.set_visible(False)
    bar.tick_params(length=0, labelsize=7.5, pad=1.0, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.legend(
        handles=[Patch(color=colour, label=sight.label) for sight, colour in _COLOURS.items()],
        loc="lower right", bbox_to_anchor=(1.0, 0.995), ncols=len(_COLOURS),
        handlelength=0.9, handleheight=0.9, borderaxespad=0.0, columnspacing=1.2, handletextpad=0.5,
    )  # fmt: skip


def _draw_strips(
    axes: Axes,
    solved: SolvedRecording,
    layers: Sequence[tuple[Array, Any, Colormap, float]],
    names: Sequence[str],
    shares: Sequence[float],
) -> AxesImage:
    """Draw layers of cells (C, N), each where a mask is true; with names, and shares of images. The first image."""
    duration_s = float(solved.seconds(np.array([solved.end_ns + solved.frame_ns]))[0])
    extent = (0.0, duration_s, len(names) - 0.5, -0.5)
    axes.set_facecolor(_NO_IMAGE)
    first, *_ = [
        axes.imshow(
            np.ma.masked_where(~shown, cells), cmap=colours, vmin=0.0, vmax=top, extent=extent, aspect="auto",
            interpolation="nearest",
        )
        for cells, shown, colours, top in layers
    ]  # fmt: skip
    axes.hlines(np.arange(len(names) - 1) + 0.5, 0.0, duration_s, color="white", linewidth=1.5)
    axes.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
    for row, share in enumerate(shares):
        axes.annotate(
            "100 %" if share == 1.0 else f"{100.0 * share:.1f} %", (1.0, row), (5, 0),
            xycoords=("axes fraction", "data"), textcoords="offset points", va="center", fontsize=8.0,
            color=QUIET if share == 1.0 else WARNING,
        )  # fmt: skip
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    return first


def sight_table(solved: SolvedRecording, max_columns: int) -> tuple[Array, Array]:
    """Fewest landmarks (C, N) and the worst ``CameraSight`` (C, N), by camera and time; NaN without an image."""
    return (
        _strip(solved, solved.cameras, lambda record: record.landmarks, np.fmin, max_columns),
        _strip(solved, solved.cameras, lambda record: record.sights, np.fmax, max_columns),
    )


def _strip(
    solved: SolvedRecording, records: Sequence[Any], values: Callable[[Any], Any], worst: np.ufunc, max_columns: int
) -> Array:
    """The worst value (C, N) of the images that share a column, by camera and time; NaN without an image."""
    frames = round((solved.end_ns - solved.start_ns) / solved.frame_ns) + 1
    columns = min(frames, max_columns)
    table = np.full((len(records), columns), np.nan)
    for row, record in enumerate(records):
        frame = np.round((record.stamps_ns - solved.start_ns) / solved.frame_ns).astype(int)
        worst.at(table[row], frame * columns // frames, np.asarray(values(record), np.float64))
    return table
