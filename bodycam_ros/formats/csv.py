"""CSV: a row per frame, for spreadsheets and pandas; joint points of other systems are read from CSV too.

Columns are the time since the first frame and its stamp [s], of every segment the position of its joint [m] and its
quaternion in the world, and the joint angles [deg]; each name ends with its unit. Where nothing is known, in a gap of a
motion with ``--rate`` and of unobserved equipment, cells are empty.
"""

import csv
import io
from pathlib import Path

import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.files.shown import shown
from bodycam_ros.formats.missing_values import cell_value, without_missing
from bodycam_ros.formats.sampled_motion import MotionOptions, SampledMotion
from bodycam_ros.geometry import Array, quaternion_xyzw

MARK = "time_s,stamp_s,"


def write_csv(motion: SampledMotion, options: MotionOptions) -> str:
    """The motion as CSV."""
    body = motion.body
    names, columns = [], []
    for segment in body.segments:
        names += [f"{segment}_{part}" for part in ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")]
        poses = motion.segment_poses(segment)
        values = np.concatenate([poses[:, :3, 3], quaternion_xyzw(poses[:, :3, :3])], axis=1)
        columns.append(np.where(motion.known_frames(segment)[:, None], values, np.nan))
    joints = [(joint, name) for joint in body.tree_joints for name in joint.angle_names]
    for column, (joint, name) in enumerate(joints):
        slides = joint.type == "free" and name.startswith(f"{joint.name}_at_")
        names.append(f"{name}_{'m' if slides else 'deg'}")
        angles = motion.joint_angles[:, column] if slides else np.degrees(motion.joint_angles[:, column])
        columns.append(np.where(motion.known_frames(joint.child), angles, np.nan)[:, None])
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([*MARK.rstrip(",").split(","), *names])
    for second, ns, row in zip(
        motion.seconds.tolist(), motion.stamps_ns.tolist(), np.concatenate(columns, axis=1).tolist(), strict=True
    ):
        cells = ("" if value != value else f"{value:.9g}" for value in row)
        writer.writerow([f"{second:.9f}", f"{ns // 10**9}.{ns % 10**9:09d}", *cells])
    return file.getvalue()


def read_csv(path: Path) -> dict[str, Array]:
    """Name -> points (K, 3) of columns NAME_x, NAME_y, NAME_z; NaN where missing (``missing_values``).

    Raises:
        RecordingError: it cannot be read, or a cell is no number.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            header, *lines = csv.reader(file)
    except (OSError, ValueError, csv.Error) as error:
        raise RecordingError(f"{path}: cannot be read as CSV with a header line: {error}") from error
    columns = {name.strip().lower(): column for column, name in enumerate(header)}
    points = {}
    for name in map(str.strip, header):
        axes = [columns.get(f"{name[:-1]}{axis}".lower()) for axis in "xyz"]
        if name[-1:].lower() == "x" and None not in axes:
            try:
                rows = [[_number(line, axis) for axis in axes] for line in lines]
            except ValueError as error:
                raise RecordingError(f"{path}: point {shown(name[:-2])}: {error}") from error
            values = np.array(rows).reshape(-1, 3)
            points[name[:-2]] = without_missing(values)
    return points


def _number(line: list[str], column: int | None) -> float:
    at = column or 0
    return cell_value(line[at]) if at < len(line) else float("nan")
