"""bodycam stations: poses of a recording's static cameras in a map, by the landmarks that they see.

A calibration file in place of the recording is converted: anipose, FreeMoCap, Pose2Sim or Caliscope TOML, Qualisys
.qca.txt, OpenCV YAML, Kalibr camchain, or a file of this command. A camera of it that cannot be used is left out.
"""

import argparse

from bodycam_ros.cli.options import add_config, add_option, add_output, check_files, read_settings
from bodycam_ros.cli.output import print_sections, shown_progress
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.errors import StaticCameraError
from bodycam_ros.evaluate.sections import column_table
from bodycam_ros.formats.calibration_files import TOML_MARK
from bodycam_ros.formats.static_cameras_file import MARK, is_calibration, read_static_cameras, write_static_cameras
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.reference_map import load_map
from bodycam_ros.replaying.static_input import UnplacedCamera, place_static_cameras
from bodycam_ros.static_cameras.static_camera_registration import RegisteredStaticCamera, StaticCamerasSettings

_COLUMNS = (
    ("images", "images", "d"), ("of", "asked", "d"), ("landmarks", "landmarks", "d"), ("error [px]", "error_px", ".2f"),
    ("sigma [mm]", "sigma_mm", ".1f"), ("sigma [deg]", "sigma_deg", ".3f"),
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_option(parser, "recording")
    add_option(parser, "--map")
    add_output(parser, "YAML", "file of cameras to write")
    parser.add_argument("--cameras", nargs="+", metavar="NAME", help="static cameras (default: all that do not move)")
    parser.add_argument(
        "--to",
        choices=("yaml", "toml"),
        default="yaml",
        help="yaml: for bodycam replay (default); toml: for anipose, Pose2Sim, FreeMoCap and Caliscope, in metres",
    )
    add_config(parser, "static_cameras.static_camera_registration:StaticCamerasSettings")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    settings = read_settings(arguments, StaticCamerasSettings)
    mark = MARK if arguments.to == "yaml" else TOML_MARK
    check_files(arguments, (arguments.output, mark.encode(), "file of static cameras that this command wrote"))
    if is_calibration(arguments.recording):
        converted = read_static_cameras(arguments.recording)
        write_static_cameras(arguments.output, converted.values(), arguments.to)
        Terminal().print(f"{len(converted)} cameras written to {arguments.output}")
        return 0
    if arguments.map is None:
        if not arguments.recording.exists():
            raise StaticCameraError(
                f"{arguments.recording}: does not exist; give a recording, or a file of static cameras"
            )
        raise StaticCameraError("the map is missing; give the map of the place with --map")
    reference_map = load_map(arguments.map)
    found: list[RegisteredStaticCamera] = []
    unplaced: list[UnplacedCamera] = []
    with open_recording(arguments.recording) as recording, shown_progress() as progress:
        cameras = list(dict.fromkeys(arguments.cameras or recording.cameras))
        for name in cameras:
            recording.image_count(name)  # raises if the recording has no such camera
        with progress.step("cameras", len(cameras)) as advance:
            for camera in place_static_cameras(recording, cameras, reference_map, settings):
                if isinstance(camera, UnplacedCamera):
                    unplaced.append(camera)
                else:
                    found.append(camera)
                advance()
    terminal = Terminal()
    if found:
        rows = {each.station.name: each for each in found}
        note = "of: images that were tried; sigma: standard deviation of the pose, all axes together"
        print_sections(terminal, [column_table("static cameras", "camera", _COLUMNS, rows, note)])
    for camera in unplaced:
        terminal.print(f"NOT placed: {camera.reason}")
    if not found:
        raise StaticCameraError(
            f"{arguments.recording}: no camera could be placed in {arguments.map}; nothing is written"
        )
    write_static_cameras(arguments.output, [camera.station for camera in found], arguments.to)
    terminal.print(f"{len(found)} of {len(cameras)} cameras written to {arguments.output}")
    return 0
