"""Panel: of how many segments each static camera said something, over time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap

from bodycam_ros.drawing.picture_style import LANDMARKS, QUIET, WARNING, panel_title
from bodycam_ros.geometry import Array
from bodycam_ros.solved.solved_recording import SolvedRecording

_MOST_COLUMNS = 900
"""Columns of the strip; of the images that share one, the worst shows."""

_NO_IMAGE = "#f7f8f9"


def draw_stations(axes: Axes, solved: SolvedRecording) -> None:
    """Draw the panel: a row per static camera, darker with more segments, red where it sees none."""
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
