"""bodycam export --to robot: a bag with a robot that follows the person, and how well it does."""

import argparse
import math

import numpy as np

from bodycam_ros.cli.options import read_settings
from bodycam_ros.cli.progress import shown_progress
from bodycam_ros.errors import SettingsError
from bodycam_ros.formats.sampled_motion import MotionOptions
from bodycam_ros.output_place import check_output
from bodycam_ros.robot.retargeting import RobotSettings
from bodycam_ros.robot.robot_recording import write_robot
from bodycam_ros.shown import printable

ROBOT = "robot"


def run_robot(arguments: argparse.Namespace, options: MotionOptions) -> int:
    """Run the command.

    Raises:
        SettingsError: the robot or the mapping is missing, or an option of other formats is given.
        BodycamError: as of ``write_robot``.
    """
    if lacking := [f"--{name}" for name in ("urdf", "mapping") if getattr(arguments, name) is None]:
        raise SettingsError(
            f"--to {ROBOT} needs {' and '.join(lacking)}: the robot, and the segments that its links follow"
        )
    if options.given:
        raise SettingsError(
            f"{', '.join(f'--{name}' for name in options.given)} has no effect on {ROBOT}; leave it out"
        )
    if len(arguments.sources) > 1:
        raise SettingsError(f"--to {ROBOT} takes one recording a call, not {len(arguments.sources)}")
    check_output(arguments.output, (*arguments.sources, arguments.urdf, arguments.mapping, arguments.config))
    settings = read_settings(arguments, RobotSettings)
    with shown_progress() as progress:
        summary = write_robot(
            arguments.sources[0],
            arguments.urdf,
            arguments.mapping,
            arguments.output,
            settings.retarget,
            arguments.force,
            progress,
        )
    errors_cm = 100.0 * np.concatenate(list(summary.errors_m.values()))
    figures = (errors_cm.mean(), np.percentile(errors_cm, 95), errors_cm.max())
    print("hands and feet from their scaled targets: mean {:.2f}, 95 % {:.2f}, at most {:.2f} cm".format(*figures))
    nearest = "no two links near" if math.isinf(summary.nearest_m) else f"{100.0 * summary.nearest_m:.1f} cm at least"
    print(f"{summary.frames} frames at {summary.scale:.2f} of the person's size; between its links {nearest}")
    if summary.blocked:
        print(f"at {summary.blocked} of them no step satisfied all limits")
    each_ms = 1e3 * summary.cpu_s / summary.frames
    print(f"{each_ms:.1f} ms of inverse kinematics a frame; written to {printable(str(arguments.output))}")
    return 0
