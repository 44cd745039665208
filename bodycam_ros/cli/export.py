"""bodycam export: a solved recording, or a body, in the format of another program.

Several recordings are written into a folder, a file each.
"""

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.cli.options import TRAVEL, add_output, add_span, given_flags, given_span
from bodycam_ros.cli.output import shown_progress
from bodycam_ros.errors import SettingsError
from bodycam_ros.files.output_place import check_output
from bodycam_ros.files.shown import printable
from bodycam_ros.formats.export import FORMATS, export
from bodycam_ros.formats.figure import BONE_NAMES, REST_POSES
from bodycam_ros.formats.sampled_motion import MAX_RATE, UP_AXES, MotionOptions
from bodycam_ros.robot.robot_recording import write_robot

ROBOT = "robot"
_OPTIONS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "rate": (
        f"frames a second, at most {MAX_RATE:g}, interpolated on SO(3) (default: the solved ones)",
        {"type": float, "metavar": "HZ"},
    ),
    "pose": ("rest pose: arms down (N, the default), out (T), between (A)", {"choices": REST_POSES}),
    "up": ("axis that is up", {"choices": UP_AXES}),
    "scale": ("units per metre, 100 for centimetres", {"type": float, "metavar": "UNITS"}),
    "names": ("naming convention of bones", {"choices": BONE_NAMES}),
    "segment": ("segment or camera, or all (default: the root)", {"metavar": "NAME"}),
    "mass": (
        "mass of the whole person: links get an inertial, by de Leva 1996 (default: none)",
        {"type": float, "metavar": "KG"},
    ),
    "character": (
        "rigged character of yours, .glb or .vrm, that moves instead of the body; bones are known by the names of "
        "Mixamo, Unreal, Blender, the CMU, 3ds Max and VRM",
        {"type": Path, "metavar": "FILE"},
    ),
    "surface": (
        "scan of the person, a mesh per segment (thigh_left.obj or .ply), that is the skin; others have their girths",
        {"type": Path, "metavar": "FOLDER"},
    ),
    "environment": (
        "place that was not there: road, slope:30 of so many degrees, or FILE.glb",
        {"metavar": "PLACE"},
    ),
    "travel": (
        "with --environment: speed that is added to the motion (default: 0)",
        TRAVEL,
    ),
    "bones": ("names of the character's bones, lines such as 'thigh_left: NAME'", {"type": Path, "metavar": "YAML"}),
}
"""Field of ``MotionOptions`` -> its meaning, and how it is parsed."""

EPILOG = f"""
formats: {"; ".join(f"{name}: {form.what}" for name, form in FORMATS.items())}; {ROBOT}: a bag with the joint states of
a robot that follows the person
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument(
        "sources",
        type=Path,
        nargs="+",
        metavar="OUT",
        help="bag that 'bodycam replay' wrote, or for urdf and mjcf a body file, YAML or URDF",
    )
    parser.add_argument("--to", choices=sorted([*FORMATS, ROBOT]), required=True, help="format to write")
    add_output(parser, "FILE", "file to write; a folder for several recordings", "files of this format")
    add_span(parser, "--until")  # --to is the format
    for option, (meaning, rest) in _OPTIONS.items():
        users = ", ".join(name for name, form in FORMATS.items() if option in form.options)
        parser.add_argument(f"--{option}", help=f"{meaning} ({users})", **rest)
    parser.add_argument("--urdf", type=Path, metavar="FILE", help=f"the robot ({ROBOT})")
    parser.add_argument(
        "--mapping",
        type=Path,
        metavar="YAML",
        help=f"links of the robot and their segments, as in config/robot ({ROBOT})",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    sources, output = arguments.sources, arguments.output
    options = MotionOptions(**{name: getattr(arguments, name) for name in _OPTIONS})
    span = given_span(arguments)
    if arguments.to == ROBOT:
        return _export_robot(arguments, options)
    if given := given_flags(arguments, "urdf", "mapping"):
        raise SettingsError(f"{', '.join(given)}: has no effect on {arguments.to}, only on {ROBOT}; leave it out")
    place = None if options.environment is None else Path(options.environment)  # of a file, or what is none
    check_output(output, (*sources, options.character, options.bones, options.surface, place))
    with shown_progress() as progress:
        written = export(sources, arguments.to, output, arguments.force, options, progress, span)
    print(f"written to {' and '.join(printable(str(path)) for path in written)}")
    return 0


def _export_robot(arguments: argparse.Namespace, options: MotionOptions) -> int:
    """Write a bag with a robot that follows the person, and print how well it does.

    Raises:
        SettingsError: the robot or the mapping is missing, or an option of other formats is given.
        BodycamError: as of ``write_robot``.
    """
    if lacking := [f"--{name}" for name in ("urdf", "mapping") if getattr(arguments, name) is None]:
        raise SettingsError(
            f"--to {ROBOT} needs {' and '.join(lacking)}: the robot, and the segments that its links follow"
        )
    if arguments.from_s is not None or arguments.to_s is not None:
        raise SettingsError(f"--from and --until have no effect on {ROBOT}; replay the part that it should follow")
    if options.given:
        raise SettingsError(
            f"{', '.join(f'--{name}' for name in options.given)} has no effect on {ROBOT}; leave it out"
        )
    if len(arguments.sources) > 1:
        raise SettingsError(f"--to {ROBOT} takes one recording a call, not {len(arguments.sources)}")
    check_output(arguments.output, (*arguments.sources, arguments.urdf, arguments.mapping))
    with shown_progress() as progress:
        scale, states, cpu_s = write_robot(
            arguments.sources[0], arguments.urdf, arguments.mapping, arguments.output, arguments.force, progress
        )
    errors_cm = 100.0 * np.array([list(state.errors_m.values()) for state in states])
    figures = (errors_cm.mean(), np.percentile(errors_cm, 95), errors_cm.max())
    print("hands and feet from their scaled targets: mean {:.2f}, 95 % {:.2f}, at most {:.2f} cm".format(*figures))
    nearest_m = min(state.nearest_m for state in states)
    nearest = "no two links near" if math.isinf(nearest_m) else f"{100.0 * nearest_m:.1f} cm at least"
    print(f"{len(states)} frames at {scale:.2f} of the person's size; between its links {nearest}")
    if blocked := sum(state.blocked for state in states):
        print(f"at {blocked} of them no step satisfied all limits")
    each_ms = 1e3 * cpu_s / len(states)
    print(f"{each_ms:.1f} ms of inverse kinematics a frame; written to {printable(str(arguments.output))}")
    return 0
