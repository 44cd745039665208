"""bodycam board: a board to print, for the scale of a map and for the calibration of lenses, and its board.yaml."""

import argparse
from pathlib import Path

from bodycam_ros.boards.board_design import MARK, board_caption, board_yaml, design_layout, scale_layout
from bodycam_ros.cli.options import add_output, check_files, number
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.errors import OutputError
from bodycam_ros.files.whole_file import whole_files

_KINDS = ("apriltag", "charuco", "checkerboard")
PAGES = {"A4": (297.0, 210.0), "A3": (420.0, 297.0), "letter": (279.4, 215.9)}
"""Widths and heights [mm], lying on their long side."""

_LEAST_MM, _MOST_MM = 80.0, 5000.0  # of a page
_STRETCH = 0.2  # largest relative error of a ruler: of a printer that fits a page to another size

EPILOG = """
Print at 100 % ("actual size"), glue it to something flat and stiff, and measure the rulers. If their lengths are not
those printed beside them, give what you measured with --ruler-mm and --force: board.yaml then describes this print.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_output(parser, "BOARD.pdf", "page to write, and beside it BOARD.yaml", "BOARD.pdf and BOARD.yaml")
    parser.add_argument("--kind", choices=_KINDS, default="apriltag", help="kind of board (%(default)s)")
    parser.add_argument(
        "--page",
        default=PAGES["A4"],
        type=_page,
        metavar="A4|A3|letter|WxH",
        help="paper, or its width x height [mm] (A4)",
    )
    parser.add_argument(
        "--up",
        choices=("x", "y", "z", "-x", "-y", "-z"),
        default="z",
        help="axis of the board that points up: z if the board lies flat, y if it hangs on a wall (%(default)s)",
    )
    parser.add_argument(
        "--ruler-mm",
        type=number(float, 0.1, _MOST_MM, "mm"),
        nargs=2,
        metavar=("ACROSS", "UPWARDS"),
        help="measured lengths of the printed rulers; board.yaml then describes this print",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.boards.board_page import board_pdf, print_area, ruler_lengths

    pdf: Path = arguments.output
    if pdf.suffix.lower() != ".pdf":
        raise OutputError(f"{pdf}: the page is a PDF; give a name that ends with .pdf")
    description = pdf.with_suffix(".yaml")
    check_files(arguments, (pdf, b"%PDF", "PDF"), (description, MARK.encode(), "board that bodycam wrote"))
    page: tuple[float, float] = arguments.page
    layout = design_layout(arguments.kind, *print_area(page)[1].tolist())
    words, rulers = board_caption(layout), ruler_lengths(page)
    content = board_pdf(layout, page, words)
    printed = layout if arguments.ruler_mm is None else scale_layout(layout, _shares(arguments.ruler_mm, rulers))
    placement = f"{'lying' if arguments.up == 'z' else 'standing'}: board {arguments.up} is up"
    text = board_yaml(printed, placement)
    with whole_files(pdf.parent, inside=True) as scratch:
        (scratch / pdf.name).write_bytes(content)
        (scratch / description.name).write_text(text, encoding="utf-8")
    console = Terminal()
    console.print(f"{words}; on {page[0]:g} x {page[1]:g} mm, written to {pdf}")
    console.print(
        f"Print it at 100 %. The rulers must measure {rulers[0]:g} mm across and {rulers[1]:g} mm upwards; if not, "
        f"give their lengths with --ruler-mm: {description} is for "
        + ("true scale." if arguments.ruler_mm is None else "the print that you measured.")
    )
    return 0


def _shares(measured_mm: list[float], rulers_mm: tuple[float, float]) -> tuple[float, float]:
    """Measured over true length of both rulers."""
    across, upwards = (m / true for m, true in zip(measured_mm, rulers_mm, strict=True))
    if max(abs(across - 1.0), abs(upwards - 1.0)) > _STRETCH:
        raise OutputError(
            f"--ruler-mm: the rulers of this board are {rulers_mm[0]:g} mm across and {rulers_mm[1]:g} mm upwards, "
            f"and no print of it measures {measured_mm[0]:g} and {measured_mm[1]:g} mm; give both, from end to end"
        )
    return across, upwards


def _page(text: str) -> tuple[float, float]:
    """Width and height [mm]."""
    try:
        width, height = PAGES.get(text) or map(float, text.lower().split("x"))
        if _LEAST_MM <= min(width, height) and max(width, height) <= _MOST_MM:
            return width, height
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(
        f"expected {', '.join(PAGES)}, or width x height from {_LEAST_MM:g} to {_MOST_MM:g} mm as in 1189x841, not "
        f"'{text}'"
    )
