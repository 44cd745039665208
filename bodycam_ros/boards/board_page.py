"""A board as a PDF page in true scale, with rulers to check the printer."""

from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from bodycam_ros.boards.board_layout import BoardLayout
from bodycam_ros.geometry import Array

_MM_PER_INCH = 25.4
_BORDER = 8.0  # [mm] that printers leave white
_RULER = 10.0  # [mm] breadth of a ruler with its numbers
_QUIET = 5.0  # [mm] between what is printed beside the board and the board
_LETTERS_PT, _TICKS_PT = 7.0, 5.5
_RULER_STEP = 50.0  # [mm] a ruler is a whole number of these long


def print_area(page_mm: tuple[float, float]) -> tuple[Array, Array]:
    """Lower left corner (2,), and width and height (2,), of the area beside the rulers [mm].

    The text beneath the board shares its strip with the lower ruler.
    """
    corner = _BORDER + _RULER + _QUIET + np.array([0.0, 4.0])
    return corner, page_mm - corner - _BORDER


def ruler_lengths(page_mm: tuple[float, float]) -> tuple[float, float]:
    """Lengths of the rulers across and upwards [mm]."""
    across, up = (max(1.0, side // _RULER_STEP) * _RULER_STEP for side in print_area(page_mm)[1].tolist())
    return across, up


def board_pdf(layout: BoardLayout, page_mm: tuple[float, float], words: str) -> bytes:
    """The page.

    Args:
        layout: what is printed.
        page_mm: width and height of the paper [mm].
        words: printed beneath the board.
    """
    corner, size = print_area(page_mm)
    figure = Figure(figsize=(page_mm[0] / _MM_PER_INCH, page_mm[1] / _MM_PER_INCH))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, page_mm[0])
    axes.set_ylim(0.0, page_mm[1])
    axes.axis("off")
    loops = [corner + 0.5 * size + 1e3 * loop for loop in layout.outlines()]
    outline = Outline.make_compound_path(*(Outline(np.vstack([loop, loop[:1]]), closed=True) for loop in loops))
    axes.add_patch(PathPatch(outline, facecolor="black", edgecolor="none", linewidth=0.0))
    across, up = ruler_lengths(page_mm)
    _draw_ruler(axes, (corner[0], _BORDER + _RULER), across, upwards=False)
    _draw_ruler(axes, (_BORDER + _RULER, corner[1]), up, upwards=True)
    beneath = f"{words}; print at 100 %; this is the lower edge"
    axes.text(corner[0], _BORDER + _RULER + 2.0, beneath, fontsize=_LETTERS_PT, va="bottom", ha="left")
    written = BytesIO()
    figure.savefig(written, format="pdf", metadata={"Title": words, "Creator": "bodycam board"})
    return written.getvalue()


def _draw_ruler(axes: Axes, start: tuple[float, float], length: float, upwards: bool) -> None:
    """Ticks each millimetre away from the board, numbers each centimetre; the first and last tick are its ends."""
    millimetres = np.arange(round(length) + 1)
    ticks = np.where(millimetres % 10 == 0, 4.5, np.where(millimetres % 5 == 0, 3.2, 2.0))
    along, across = millimetres + start[upwards], start[not upwards]
    lines = np.stack(
        [np.column_stack([along, np.full_like(ticks, across)]), np.column_stack([along, across - ticks])], 1
    )
    lines = np.concatenate([lines, [[[along[0], across], [along[-1], across]]]])
    outline = Outline.make_compound_path(*(Outline(line[:, ::-1] if upwards else line) for line in lines))
    axes.add_patch(PathPatch(outline, fill=False, edgecolor="black", linewidth=0.3, capstyle="butt"))
    for millimetre in millimetres[::10].tolist():
        number = f"{millimetre}{' mm' if millimetre == round(length) else ''}"
        if upwards:
            axes.text(across - 5.2, start[1] + millimetre, number, fontsize=_TICKS_PT, ha="right", va="center")
        else:
            axes.text(start[0] + millimetre, across - 5.2, number, fontsize=_TICKS_PT, ha="center", va="top")
