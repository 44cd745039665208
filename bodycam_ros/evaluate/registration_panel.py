"""Panels: a row per camera over time, with what was registered."""

from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from numpy.typing import NDArray

from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.geometry import Array
from bodycam_ros.plots.picture_style import (
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

_MOST_COLUMNS = 900
"""Columns of the strip; of the images that share one, the worst shows."""

_NO_IMAGE = "#f7f8f9"


def draw_stations(axes: Axes, evaluation: Evaluation) -> None:
    """Draw the panel: a row per static camera, darker with more segments, red where it sees none."""
    solved = evaluation.solved
    segments = segment_table(solved, _MOST_COLUMNS)
    duration_s = float(solved.seconds(np.array([solved.end_ns + solved.frame_ns]))[0])
    extent = (0.0, duration_s, len(solved.stations) - 0.5, -0.5)
    axes.set_facecolor(_NO_IMAGE)
    most = float(np.nanmax(segments, initial=1.0))
    for cells, colours, highest in (
        (np.ma.masked_invalid(np.where(segments > 0.0, segments, np.nan)), LANDMARKS, most),
        (np.ma.masked_invalid(np.where(segments == 0.0, 1.0, np.nan)), ListedColormap([WARNING]), 1.0),
    ):
        axes.imshow(cells, cmap=colours, vmin=0.0, vmax=highest, extent=extent, aspect="auto", interpolation="nearest")
    axes.hlines(np.arange(len(solved.stations) - 1) + 0.5, 0.0, duration_s, color="white", linewidth=1.5)
    axes.set_yticks(range(len(solved.stations)), [record.station.replace("_", " ") for record in solved.stations])
    for row, record in enumerate(solved.stations):
        seen = float(record.sees.mean())
        axes.annotate(
            f"{100.0 * seen:.1f} %".replace("100.0", "100"), (1.0, row), (5, 0),
            xycoords=("axes fraction", "data"), textcoords="offset points", va="center", fontsize=8.0,
            color=QUIET if seen == 1.0 else WARNING,
        )  # fmt: skip
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    panel_title(axes, "Static cameras", f"segments that each sees, dark: {most:.0f}; red: none")


def segment_table(solved: SolvedRecording, most_columns: int) -> Array:
    """Fewest segments that were seen (C, N), by static camera and time; NaN without an image."""
    frames = round((solved.end_ns - solved.start_ns) / solved.frame_ns) + 1
    columns = min(frames, most_columns)
    segments = np.full((len(solved.stations), columns), np.inf)
    for row, record in enumerate(solved.stations):
        frame = np.round((record.stamps_ns - solved.start_ns) / solved.frame_ns).astype(int)
        np.minimum.at(segments[row], frame * columns // frames, record.segments)
    return np.where(np.isinf(segments), np.nan, segments)


_COLOURS = MappingProxyType(
    {CameraSight.RELATIVE: RELATIVE, CameraSight.ROTATION_ONLY: ROTATION_ONLY, CameraSight.BLIND: WARNING}
)


def draw_sights(axes: Axes, evaluation: Evaluation) -> None:
    """Draw the panel: a row per camera, darker with more landmarks; other colours where it is not in the map."""
    solved = evaluation.solved
    landmarks, sights = sight_table(solved, _MOST_COLUMNS)
    duration_s = float(solved.seconds(np.array([solved.end_ns + solved.frame_ns]))[0])
    extent = (0.0, duration_s, len(solved.cameras) - 0.5, -0.5)
    axes.set_facecolor(_NO_IMAGE)
    image = axes.imshow(
        np.ma.masked_where(sights != CameraSight.REGISTERED, landmarks),
        cmap=LANDMARKS, vmin=0.0, vmax=_round_up(landmarks), extent=extent, aspect="auto", interpolation="nearest",
    )  # fmt: skip
    for sight, colour in _COLOURS.items():
        here = np.ma.masked_where(sights != sight, np.ones_like(landmarks))
        axes.imshow(here, cmap=ListedColormap([colour]), extent=extent, aspect="auto", interpolation="nearest")
    axes.hlines(np.arange(len(solved.cameras) - 1) + 0.5, 0.0, duration_s, color="white", linewidth=1.5)
    _label_rows(axes, evaluation)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    panel_title(axes, "Camera registration", "landmarks per image")
    bar = axes.inset_axes((0.46, 1.025, 0.14, 0.022))
    colours = axes.figure.colorbar(image, cax=bar, orientation="horizontal", ticks=[0.0, _round_up(landmarks)])
    colours.outline.set_visible(False)
    bar.tick_params(length=0, labelsize=7.5, pad=1.0, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.legend(
        handles=[Patch(color=colour, label=sight.label) for sight, colour in _COLOURS.items()],
        loc="lower right", bbox_to_anchor=(1.0, 0.995), ncols=len(_COLOURS),
        handlelength=0.9, handleheight=0.9, borderaxespad=0.0, columnspacing=1.2, handletextpad=0.5,
    )  # fmt: skip


def sight_table(solved: SolvedRecording, most_columns: int) -> tuple[Array, Array]:
    """Fewest landmarks (C, N) and the worst ``CameraSight`` (C, N), by camera and time; NaN without an image."""
    frames = round((solved.end_ns - solved.start_ns) / solved.frame_ns) + 1
    columns = min(frames, most_columns)
    landmarks = np.full((len(solved.cameras), columns), np.inf)
    sights = np.full(landmarks.shape, -np.inf)
    for row, record in enumerate(solved.cameras):
        frame = np.round((record.stamps_ns - solved.start_ns) / solved.frame_ns).astype(int)
        column = frame * columns // frames
        np.minimum.at(landmarks[row], column, record.landmarks)
        np.maximum.at(sights[row], column, record.sights)
    return np.where(np.isinf(landmarks), np.nan, landmarks), np.where(np.isinf(sights), np.nan, sights)


def _round_up(landmarks: Array) -> float:
    """The end of the colour scale: most cells lie below, and it is a round number."""
    known: NDArray[np.float64] = landmarks[np.isfinite(landmarks)]
    top = float(np.percentile(known, 98)) if known.size else 1.0
    return float(max(10.0, 10.0 * np.ceil(top / 10.0)))


def _label_rows(axes: Axes, evaluation: Evaluation) -> None:
    names = [health.camera for health in evaluation.cameras]
    axes.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
    for label, name in zip(axes.get_yticklabels(), names, strict=True):
        label.set_color(side_colour(name))
    for row, health in enumerate(evaluation.cameras):
        perfect = health.registered == 1.0
        axes.annotate(
            "100 %" if perfect else f"{100.0 * health.registered:.1f} %", (1.0, row), (5, 0),
            xycoords=("axes fraction", "data"), textcoords="offset points", va="center", fontsize=8.0,
            color=QUIET if perfect else WARNING,
        )  # fmt: skip
