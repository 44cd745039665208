"""TUM: the trajectory of the root, of a segment or of a camera, for evo and what else scores SLAM.

A line is the stamp [s], the place [m] and the quaternion x y z w, in the world. ``--segment all`` writes every
segment, each into a file beside the root's. Where nothing is known, in a gap, there is no line.
"""

import numpy as np

from bodycam_ros.errors import BodyError
from bodycam_ros.export.options import MotionOptions
from bodycam_ros.export.sampled_motion import SampledMotion
from bodycam_ros.geometry import Array, quaternion_xyzw

MARK = "# time x y z qx qy qz qw"
ALL = "all"


def tum(motion: SampledMotion, options: MotionOptions) -> dict[str, str]:
    """Trajectories, by the suffixes of their files.

    Raises:
        BodyError: the body has no such segment or camera.
    """
    body, wanted = motion.body, options.segment or motion.body.root
    if wanted == ALL:
        others = [segment for segment in body.segments if segment != body.root]
        return {"": _lines(motion, body.root), **{f".{_in_a_path(s)}.tum": _lines(motion, s) for s in others}}
    if wanted in body.segments:
        return {"": _lines(motion, wanted)}
    if wanted in body.mounts:
        mount = body.mounts[wanted]
        return {"": _lines(motion, mount.segment, mount.segment_T_camera)}
    raise BodyError(
        f"--segment {wanted}: the body has no such segment or camera; there are "
        f"{', '.join((*body.segments, *body.mounts))}, and {ALL}"
    )


def _in_a_path(segment: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in segment)


def _lines(motion: SampledMotion, segment: str, segment_T_camera: Array | None = None) -> str:
    poses = motion.poses_of(segment)
    if segment_T_camera is not None:
        poses = poses @ segment_T_camera
    numbers = np.concatenate([poses[:, :3, 3], quaternion_xyzw(poses[:, :3, :3])], axis=1)
    known = motion.knows(segment)
    rows = zip(motion.stamps_ns[known].tolist(), numbers[known].tolist(), strict=True)
    lines = [f"{ns // 10**9}.{ns % 10**9:09d} {' '.join(map('{:.9f}'.format, row))}" for ns, row in rows]
    return "\n".join([MARK, *lines]) + "\n"
