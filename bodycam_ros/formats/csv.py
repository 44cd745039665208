"""CSV: a row an instant, for spreadsheets and pandas.

Columns are the time since the first instant and as it was stamped [s], of every segment the place of its joint [m] and
its quaternion in the world, and the joint angles [deg]; the name of each says its unit. Where nothing is known, in
a gap of a motion with ``--rate`` and of equipment that was not seen, cells are empty.
"""

import numpy as np

from bodycam_ros.formats.options import MotionOptions
from bodycam_ros.formats.sampled_motion import SampledMotion
from bodycam_ros.geometry import quaternion_xyzw

MARK = "time_s,stamp_s,"


def csv(motion: SampledMotion, options: MotionOptions) -> str:
    """The motion as CSV."""
    body = motion.body
    stamps = [f"{stamp // 10**9}.{stamp % 10**9:09d}" for stamp in motion.stamps_ns.tolist()]
    names, columns = [], []
    for segment in body.segments:
        names += [f"{segment}_{part}" for part in ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")]
        poses = motion.poses_of(segment)
        places = np.concatenate([poses[:, :3, 3], quaternion_xyzw(poses[:, :3, :3])], axis=1)
        places[~motion.knows(segment)] = np.nan
        columns.append(places)
    column = 0
    for joint in body.tree_joints:
        for name in joint.angle_names:
            slides = joint.type == "free" and name.startswith(f"{joint.name}_at_")
            names.append(f"{name}_{'m' if slides else 'deg'}")
            values = motion.angles[:, column] if slides else np.degrees(motion.angles[:, column])
            columns.append(np.where(motion.knows(joint.child), values, np.nan)[:, None])
            column += 1
    header = MARK + ",".join(map(_cell, names))
    numbers = np.concatenate(columns, axis=1)
    rows = zip(motion.seconds.tolist(), stamps, numbers.tolist(), strict=True)
    lines = [f"{second:.9f},{stamp},{','.join(map(_number, row))}" for second, stamp, row in rows]
    return "\n".join([header, *lines]) + "\n"


def _number(value: float) -> str:
    return "" if value != value else f"{value:.9g}"


def _cell(text: str) -> str:
    return f'"{text.replace(chr(34), chr(34) * 2)}"' if any(c in text for c in ',"\n') else text
