"""Panel: how far the points of each attachment to the equipment were from each other, over time (B figure 12)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from bodycam_ros.body.equipment_report import EquipmentRecord
from bodycam_ros.evaluate.summary import MM_PER_M
from bodycam_ros.evaluate.time_panels import broken_at_gaps
from bodycam_ros.plots.picture_style import QUIET, light_grid, panel_title, side_colour
from bodycam_ros.results.solved_recording import SolvedRecording

_DASHES: tuple[tuple[int, tuple[int, ...]], ...] = ((0, ()), (0, (6, 2)), (0, (3, 1, 1, 1)), (0, (1, 1)))
"""Of what is held, by its name without the side."""

_LEAST_MM = 0.1
"""A logarithm needs an end; no camera sees less."""

_ROOM = 1.5


def draw_equipment(axes: Axes, solved: SolvedRecording, record: EquipmentRecord) -> None:
    """Draw the panel: a line per attachment in the colour of its side, thin and faint while it did not hold."""
    panel_title(axes, f"Distance from {record.name}", "between points that should coincide; faint: let go")
    kinds = list(dict.fromkeys(map(_kind, record.attachments)))
    low, high = np.inf, 10.0 * _LEAST_MM
    handles = []
    for column, name in enumerate(record.attachments):
        distance = np.maximum(MM_PER_M * record.deviations[:, column], _LEAST_MM)
        held = record.held[:, column]
        known = distance[np.isfinite(distance)]
        if known.size:
            low, high = min(low, float(known.min())), max(high, float(known.max()))
        colour, dashes = side_colour(name), _DASHES[kinds.index(_kind(name)) % len(_DASHES)]
        for shown, width, alpha in ((_joined(held), 1.5, 1.0), (_joined(~held), 0.8, 0.45)):
            curve = broken_at_gaps(solved, record.stamps_ns, np.where(shown, distance, np.nan))
            axes.plot(*curve, linewidth=width, alpha=alpha, color=colour, linestyle=dashes)
        handles.append(Line2D([], [], label=name, linewidth=1.5, color=colour, linestyle=dashes))
    axes.set_yscale("log")
    axes.set_ylim(min(low, high / 10.0) / _ROOM, high * _ROOM)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylabel("distance [mm]")
    axes.set_xlabel("time [s]")
    if not record.placed.any():
        axes.text(0.5, 0.5, "it is not known where it was", transform=axes.transAxes, ha="center", color=QUIET)
    axes.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=len(handles), borderaxespad=0)
    light_grid(axes)


def _kind(name: str) -> str:
    return name.removesuffix("_left").removesuffix("_right")


def _joined(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The mask (T,), a step longer at the beginning of each stretch, so that lines meet."""
    longer: NDArray[np.bool_] = mask | np.concatenate([mask[1:], [False]])
    return longer
