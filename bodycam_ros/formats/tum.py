"""TUM: the trajectory of the root, of a segment or of a camera, for evo and other evaluations of SLAM.

A line is the stamp [s], the position [m] and the quaternion x y z w, in the world. ``--segment all`` writes every
segment, each to a file beside the root's. In a gap there is no line.
"""

import re
from decimal import Decimal, DecimalException
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import BodyError, RecordingError
from bodycam_ros.files.distinct_names import distinct_names
from bodycam_ros.files.shown import shown
from bodycam_ros.files.yaml_file import read_text
from bodycam_ros.formats.captured_motion import CapturedMotion, own_times
from bodycam_ros.formats.sampled_motion import MotionOptions, SampledMotion
from bodycam_ros.geometry import Array, quaternion_xyzw, rigid, rotation_from_xyzw
from bodycam_ros.results.body_motion import interpolated

MARK = "# time x y z qx qy qz qw"
ALL = "all"


def write_tum(motion: SampledMotion, options: MotionOptions) -> dict[str, str]:
    """Trajectories, by the suffixes of their files.

    Raises:
        BodyError: the body has no such segment or camera.
    """
    body, wanted = motion.body, options.segment or motion.body.root
    if wanted == ALL:
        others = [segment for segment in body.segments if segment != body.root]
        parts = distinct_names(others, _path_part)
        return {"": _lines(motion, body.root), **{f".{parts[s]}.tum": _lines(motion, s) for s in others}}
    if wanted in body.segments:
        return {"": _lines(motion, wanted)}
    if wanted in body.mounts:
        mount = body.mounts[wanted]
        return {"": _lines(motion, mount.segment, mount.segment_T_camera)}
    raise BodyError(
        f"--segment {wanted}: the body has no such segment or camera; there are "
        f"{', '.join((*body.segments, *body.mounts))}, and {ALL}"
    )


def _path_part(segment: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in segment)


def _lines(motion: SampledMotion, segment: str, segment_T_camera: Array | None = None) -> str:
    poses = motion.segment_poses(segment)
    if segment_T_camera is not None:
        poses = poses @ segment_T_camera
    numbers = np.concatenate([poses[:, :3, 3], quaternion_xyzw(poses[:, :3, :3])], axis=1)
    known = motion.known_frames(segment)
    rows = zip(motion.stamps_ns[known].tolist(), numbers[known].tolist(), strict=True)
    lines = [f"{ns // 10**9}.{ns % 10**9:09d} {' '.join(map('{:.9f}'.format, row))}" for ns, row in rows]
    return "\n".join([MARK, *lines]) + "\n"


_NANOSECONDS = Decimal(10**9)
_COLUMNS = 8
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|(?i:[-+]?(nan|inf))")
_MAX_QUOTE = 200


def read_tum(path: Path) -> tuple[NDArray[np.int64], Array]:
    """Stamps (K,) [ns] and poses (K, 4, 4) [m] of a TUM file: time [s], x y z [m], quaternion x y z w per line.

    Stamps are read as decimals: a float of today's seconds is 0.2 microseconds coarse.

    Raises:
        RecordingError: it cannot be read, or is no such file.
    """
    text = read_text(path, "trajectory", RecordingError)
    try:
        lines = []
        for number, line in enumerate(text.splitlines(), 1):
            if line.strip() and not line.startswith("#"):
                lines.append(words := line.split())
                if len(words) != _COLUMNS:
                    raise ValueError(f"line {number}: expected {_COLUMNS} numbers")
                if other := next((word for word in words if not _NUMBER.fullmatch(word)), ""):
                    raise ValueError(f"line {number}: {shown(other)} is no number")
        stamps = np.array([int((Decimal(words[0]) * _NANOSECONDS).to_integral_value()) for words in lines], np.int64)
        rows = np.array([[float(word) for word in words[1:]] for words in lines])
        if len(rows) and not np.isfinite(rows).all():
            raise ValueError("expected finite numbers")
        own = own_times(path, stamps)
        stamps, rows = stamps[own], rows[own]
        if len(rows) < 2 or not (np.diff(stamps) > 0).all():
            raise ValueError("expected two lines or more, with increasing stamps")
        return stamps, rigid(rotation_from_xyzw(rows[:, 3:]), rows[:, :3])
    except (ValueError, DecimalException, OverflowError) as error:
        text = str(error)[:_MAX_QUOTE]  # it may quote a damaged line
        raise RecordingError(f"{path}: cannot be read as a trajectory in TUM format: {text}") from error


def read_captured_tum(path: Path) -> CapturedMotion:
    """The bodies of a TUM file, or of all ``*.tum`` in a folder: each is named after its file.

    All are interpolated at the stamps of the first; NaN outside of a file's own stamps.

    Raises:
        RecordingError: a file cannot be read, or there is none.
    """
    files = sorted(path.glob("*.tum")) if path.is_dir() else [path]
    if not files:
        raise RecordingError(f"{path}: has no file *.tum")
    bodies = {file.stem: read_tum(file) for file in files}
    stamps_ns = next(iter(bodies.values()))[0]
    points, rotations = {}, {}
    for name, (own_ns, poses) in bodies.items():
        at_ns = np.clip(stamps_ns, own_ns[0], own_ns[-1])
        brought = poses if np.array_equal(own_ns, stamps_ns) else interpolated(own_ns, poses, at_ns)
        points[name] = np.where((at_ns == stamps_ns)[:, None], brought[:, :3, 3], np.nan)
        rotations[name] = np.ascontiguousarray(brought[:, :3, :3])
    return CapturedMotion(path, "TUM", stamps_ns, points, rotations)
