"""Equipment in figures and a picture: how well a body was coupled to it."""

from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from bodycam_ros.body.equipment_report import EquipmentRecord
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.evaluate.figures import AttachmentFigures, EquipmentFigures, LengthFigures, spread
from bodycam_ros.results.colours import QUIET, side_colour
from bodycam_ros.results.picture_style import light_grid, panel_title
from bodycam_ros.results.solved_recording import SolvedRecording

_MIN_GAP_MM = 0.1  # lower end of the logarithmic scale; cameras measure no less
_DASHES: tuple[tuple[int, tuple[int, ...]], ...] = ((0, ()), (0, (6, 2)), (0, (3, 1, 1, 1)), (0, (1, 1)))
"""Dashes of attachments, by name without the side."""


def equipment_figures(record: EquipmentRecord, start_ns: int) -> EquipmentFigures:
    """How well the body was coupled to its equipment.

    Args:
        record: of a solved recording.
        start_ns: of the recording [ns].
    """
    attachments = {}
    for column, name in enumerate(record.attachments):
        held, deviations = record.held[:, column], record.deviations[:, column]
        attachments[name] = AttachmentFigures(
            held=float(held.mean()),
            deviation_mm=spread(deviations[held], 1e3),
            apart_mm=spread(deviations[~held & record.placed], 1e3),
            let_go_s=[[1e-9 * (stamp - start_ns) for stamp in stretch] for stretch in record.let_go(column)],
        )
    lengths = zip(record.lengths, (1e3 * record.values).tolist(), (1e3 * record.sigmas).tolist(), strict=True)
    placed = record.stamps_ns[record.placed]
    return EquipmentFigures(
        name=record.name,
        placed=float(np.mean(record.placed)),
        placed_from_s=1e-9 * float(placed[0] - start_ns) if placed.size else None,
        attachments=attachments,
        lengths={name: LengthFigures(value, sigma) for name, value, sigma in lengths},
    )


def draw_equipment(axes: Axes, solved: SolvedRecording, record: EquipmentRecord) -> None:
    """Draw the distance of each attachment's points over time (B figure 12), thin and faint while it was released."""
    panel_title(axes, f"Distance from {record.name}", "between points that should coincide; faint: released")
    dashes = dict(zip(dict.fromkeys(SegmentName(name).kind for name in record.attachments), cycle(_DASHES)))
    distances = np.maximum(1e3 * record.deviations, _MIN_GAP_MM)
    handles = []
    for name, distance, held in zip(record.attachments, distances.T, record.held.T, strict=True):
        style: Any = {"color": side_colour(name), "linestyle": dashes[SegmentName(name).kind]}
        for mask, width, alpha in ((held, 1.5, 1.0), (~held, 0.8, 0.45)):
            # A step longer at the beginning of each stretch, so that lines meet.
            shown = mask | np.append(mask[1:], False)
            curve = solved.curve(record.stamps_ns, np.where(shown, distance, np.nan))
            axes.plot(*curve, linewidth=width, alpha=alpha, **style)
        handles.append(Line2D([], [], label=name, linewidth=1.5, **style))
    high = float(np.nanmax(distances, initial=10.0 * _MIN_GAP_MM))
    axes.set_yscale("log")
    axes.set_ylim(float(np.nanmin(distances, initial=high / 10.0)) / 1.5, high * 1.5)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylabel("distance [mm]")
    axes.set_xlabel("time [s]")
    if not record.placed.any():
        axes.text(0.5, 0.5, "its pose was never known", transform=axes.transAxes, ha="center", color=QUIET)
    axes.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=len(handles), borderaxespad=0)
    light_grid(axes)
