"""bodycam lens: the lens of a camera, measured by pictures of a board, as a camera_info YAML."""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from bodycam_ros.boards.board_design import read_layout
from bodycam_ros.boards.board_detector import LensBoard
from bodycam_ros.camera.camera_info import camera_info_yaml
from bodycam_ros.cli.options import add_output, check_files
from bodycam_ros.cli.output import print_sections, shown_progress
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.errors import OutputError
from bodycam_ros.evaluate.sections import column_table
from bodycam_ros.files.whole_file import write_whole
from bodycam_ros.lens.lens_calibration import LensCalibration, calibrate_lens
from bodycam_ros.lens.lens_images import lens_images
from bodycam_ros.results.verdict import WRONG_RESULT

_MODELS = ("equidistant", "fov", "plumb_bob", "rational_polynomial")

_COLUMNS = (
    ("fx [px]", "fit.camera.fx", ".1f"), ("fy [px]", "fit.camera.fy", ".1f"), ("cx [px]", "fit.camera.cx", ".1f"),
    ("cy [px]", "fit.camera.cy", ".1f"), ("fitted [px]", "fit.median_px", ".3f"),
    ("held out [px]", "median_px", ".3f"), ("rays [px]", "worst_ray_px", ".2f"),
    ("corners [px]", "corner_px", ".1f"),
)  # fmt: skip

_MARK = "# lens measured by bodycam"

EPILOG = """
Film for a minute, in the mode of your later recordings, with stabilisation off. The board should fill a third of the
picture. Show it in every part of the picture, out to the corners, straight and tilted by 30 to 45 deg to all sides;
stop at each place. A checkerboard must be whole in each picture. Exit code: 0 if LENS.yaml was written (warnings tell
what would make it better), 3 if no lens fits the pictures, 1 if a file cannot be used.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument(
        "pictures", type=Path, nargs="+", metavar="VIDEO_OR_IMAGES", help="a video, images, or a folder with images"
    )
    parser.add_argument(
        "--board", type=Path, required=True, metavar="YAML", help="what the board is; see docs/board.md"
    )
    add_output(
        parser,
        "LENS.yaml",
        "file to write, and beside it LENS.png",
        "LENS.yaml of bodycam lens, and LENS.png",
    )
    parser.add_argument(
        "--model",
        choices=("auto", *_MODELS),
        default="auto",
        help="camera model; auto: the simplest one that fits the test pictures as well as the best (%(default)s)",
    )
    parser.add_argument("--name", help="name of the camera (default: the name of LENS.yaml)")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from bodycam_ros.lens.calibration_plot import calibration_plot

    output: Path = arguments.output
    if output.suffix.lower() not in (".yaml", ".yml"):
        raise OutputError(f"{output}: a lens is a camera_info YAML; give a name that ends with .yaml")
    picture = output.with_suffix(".png")
    files = (output, _MARK.encode(), "lens that bodycam wrote"), (picture, b"\x89PNG", "PNG")
    check_files(arguments, *files)
    board = LensBoard(str(arguments.board), read_layout(arguments.board))
    models = _MODELS if arguments.model == "auto" else (arguments.model,)
    name = arguments.name or output.stem
    with shown_progress() as progress:
        pictures = lens_images(arguments.pictures)
        calibration = calibrate_lens(pictures, board, models, progress)
    console = Terminal()
    rows = {trial.model: trial for trial in calibration.trials}
    print_sections(console, [column_table(f"lens: {calibration.chosen.model}", "model", _COLUMNS, rows)])
    _print_found(console, calibration)
    write_whole(picture, calibration_plot(calibration, f"Lens {name}: {calibration.chosen.model}"))
    for warning in calibration.warnings:
        console.print(f"warning: {warning}", style="yellow")
    if calibration.objections:
        for why in calibration.objections:
            console.print(f"rejected: {why}", style="red")
        console.print(f"no lens was written; {picture} shows where the board was seen")
        return WRONG_RESULT
    write_whole(output, _text(calibration, name, board.name))
    console.print(f"written to {output}; {picture} shows coverage and errors")
    return 0


def _text(calibration: LensCalibration, name: str, board: str) -> str:
    lens = calibration.chosen
    fx, fy, cx, cy = lens.lens_sigma[:4]
    lines = [
        f"{_MARK} by {len(lens.fit.views)} pictures of {Path(board).name}; those held out are off by",
        f"# {lens.median_px:.3f} px (median), rays where the board was seen by up to {lens.worst_ray_px:.2f} px,",
        f"# in the corners {f'by up to {lens.corner_px:.1f} px' if np.isfinite(lens.corner_px) else 'without a ray'};",
        f"# standard deviations [px]: fx {fx:.2f}, fy {fy:.2f}, cx {cx:.2f}, cy {cy:.2f}",
        *(f"# warning: {warning}" for warning in calibration.warnings),
    ]
    return "\n".join(lines) + f"\n{camera_info_yaml(replace(lens.fit.camera, name=name))}"


def _print_found(console: Terminal, calibration: LensCalibration) -> None:
    area, views = calibration.area, calibration.chosen.fit.views
    if calibration.remark:
        console.print(calibration.remark, style="yellow")
    console.print(
        f"{calibration.given} pictures, {calibration.found} show the board, {len(views)} are used; the board covers "
        f"{area.coverage:.0%} of the picture, out to {area.reach:.0%} of its radius, in {area.tilts} tilts"
    )
