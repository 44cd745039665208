"""Panels: a row per camera over time, with what it measured."""

from collections.abc import Callable, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.image import AxesImage
from matplotlib.patches import Patch

from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import (
    LANDMARKS,
    QUIET,
    RELATIVE,
    ROTATION_ONLY,
    WARNING,
    panel_title,
    side_colour,
)
from bodycam_ros.registration.landmark_matches import CameraSight
from bodycam_ros.results.solved_recording import SolvedRecording

_MAX_COLUMNS = 900
"""Columns of the strip; of the images that share one, the worst shows."""

_NO_IMAGE = "#f7f8f9"
_COLOURS = MappingProxyType(
    {CameraSight.RELATIVE: RELATIVE, CameraSight.ROTATION_ONLY: ROTATION_ONLY, CameraSight.BLIND: WARNING}
)


def draw_registrations(axes: Axes, evaluation: Evaluation) -> None:
    """Draw body cameras; without any, static cameras."""
    (_draw_body_cameras if evaluation.cameras else _draw_static_cameras)(axes, evaluation)


def _draw_static_cameras(axes: Axes, evaluation: Evaluation) -> None:
    """A row per static camera, darker with more segments, red without any."""
    records = evaluation.solved.stations
    segments = _strip(evaluation.solved, records, lambda record: record.segments, np.fmin, _MAX_COLUMNS)
    most = float(np.nanmax(segments, initial=1.0))
    layers = [(segments, segments > 0.0, LANDMARKS, most), (segments, segments == 0.0, ListedColormap([WARNING]), 1.0)]
    names, shares = [record.station for record in records], [float(record.sees.mean()) for record in records]
    _draw_strips(axes, evaluation.solved, layers, names, shares)
    panel_title(axes, "Static cameras", f"segments that each observes, dark: {most:.0f}; red: none")


def _draw_body_cameras(axes: Axes, evaluation: Evaluation) -> None:
    """A row per camera, darker with more landmarks; other colours where it is not registered in the map."""
    landmarks, sights = sight_table(evaluation.solved, _MAX_COLUMNS)
    known = landmarks[np.isfinite(landmarks)]
    top = float(np.percentile(known, 98)) if known.size else 1.0
    top = max(10.0, 10.0 * np.ceil(top / 10.0))
    layers: list[tuple[Array, Any, Colormap, float]] = [(landmarks, sights == CameraSight.REGISTERED, LANDMARKS, top)]
    layers += [(sights, sights == sight, ListedColormap([colour]), 1.0) for sight, colour in _COLOURS.items()]
    names, shares = zip(*((each.camera, each.registered) for each in evaluation.cameras), strict=True)
    image = _draw_strips(axes, evaluation.solved, layers, names, shares)
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
