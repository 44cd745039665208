"""bodycam board: a board to print, for the scale of a map and for the calibration of lenses, and its board.yaml."""

import argparse
from pathlib import Path

from bodycam_ros.cli.options import add_output, number
from bodycam_ros.errors import OutputError
from bodycam_ros.output_place import check_file, check_output

_KINDS = ("apriltag", "charuco", "checkerboard")
_PAGES = ("A4", "A3", "letter")
_PAGE_MM = (80.0, 5000.0)
_MM = number(float, 0.1, _PAGE_MM[1], "mm")
_STRETCH = 0.2
"""Largest relative error of a ruler: of a printer that fits a page to another size."""
_DIRECTIONS = ("x", "y", "z", "-x", "-y", "-z")

_EPILOG = """
Print at 100 % ("actual size"), glue it to something flat and stiff, and measure the rulers. If their lengths are not
those printed beside them, give what you measured with --ruler-mm and --force: board.yaml then describes this print.
"""


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("board", description=__doc__, epilog=_EPILOG)
    add_output(parser, "BOARD.pdf", "page to write, and beside it BOARD.yaml", "BOARD.pdf and BOARD.yaml")
    parser.add_argument("--kind", choices=_KINDS, default="apriltag", help="what is on it (%(default)s)")
    parser.add_argument(
        "--page", default="A4", type=_page, metavar="A4|A3|letter|WxH", help="paper, or its width x height [mm] (A4)"
    )
    parser.add_argument(
        "--up",
        choices=_DIRECTIONS,
        default="z",
        help="which way of the board points up where it is placed: z if it lies, y if it hangs on a wall (%(default)s)",
    )
    parser.add_argument(
        "--ruler-mm",
        type=_MM,
        nargs=2,
        metavar=("ACROSS", "UPWARDS"),
        help="how long the printed rulers really are: board.yaml becomes right for that print",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.lens.board_design import MARK, board_caption, board_yaml, design_layout, scale_layout
    from bodycam_ros.lens.board_page import PAGES, board_pdf, print_area, ruler_lengths
    from bodycam_ros.terminal import Terminal
    from bodycam_ros.whole_file import whole_files

    pdf: Path = arguments.output
    if pdf.suffix.lower() != ".pdf":
        raise OutputError(f"{pdf}: the page is a PDF; give a name that ends with .pdf")
    description = pdf.with_suffix(".yaml")
    for path, mark, what in ((pdf, b"%PDF", "PDF"), (description, MARK.encode(), "board that bodycam wrote")):
        check_output(path, ())
        check_file(path, arguments.force, mark, what)
    page = PAGES[arguments.page] if arguments.page in PAGES else _size_mm(arguments.page)
    layout = design_layout(arguments.kind, print_area(page))
    words, rulers = board_caption(layout), ruler_lengths(page)
    content = board_pdf(layout, page, words)
    printed = layout if arguments.ruler_mm is None else scale_layout(layout, _shares(arguments.ruler_mm, rulers))
    placement = f"{'lying' if arguments.up == 'z' else 'standing'}: board {arguments.up} is up"
    text = board_yaml(printed, placement)
    with whole_files(pdf.parent, inside=True) as scratch:
        (scratch / pdf.name).write_bytes(content)
        (scratch / description.name).write_text(text, encoding="utf-8")
    console = Terminal()
    console.print(f"{words}; on {page[0]:g} x {page[1]:g} mm, written to {pdf}", soft_wrap=True)
    console.print(
        f"Print it at 100 %. The rulers must measure {rulers[0]:g} mm across and {rulers[1]:g} mm upwards; if not, "
        f"give their lengths with --ruler-mm: {description} is for "
        + ("true scale." if arguments.ruler_mm is None else "the print that you measured."),
        soft_wrap=True,
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


def _page(text: str) -> str:
    if text in _PAGES:
        return text
    try:
        sizes = _size_mm(text)
    except ValueError:
        sizes = (0.0, 0.0)
    if not all(_PAGE_MM[0] <= size <= _PAGE_MM[1] for size in sizes):
        raise argparse.ArgumentTypeError(
            f"expected {', '.join(_PAGES)}, or width x height from {_PAGE_MM[0]:g} to {_PAGE_MM[1]:g} mm as in 1189x841"
            f", not '{text}'"
        )
    return text


def _size_mm(text: str) -> tuple[float, float]:
    width, height = map(float, text.lower().split("x"))
    return width, height
