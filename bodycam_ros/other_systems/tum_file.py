"""Trajectories in TUM format: one body over time, as robots and SLAM systems write it."""

from decimal import Decimal, DecimalException
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array, rigid, rotation_from_xyzw
from bodycam_ros.other_systems.captured_motion import CapturedMotion
from bodycam_ros.solved.trajectory import interpolated
from bodycam_ros.yaml_file import read_text

_NANOSECONDS = Decimal(10**9)
_COLUMNS = 8
_LONGEST_TOLD = 200


def read_tum(path: Path) -> tuple[NDArray[np.int64], Array]:
    """Stamps (K,) [ns] and poses (K, 4, 4) [m] of a TUM file: time [s], x y z [m], quaternion x y z w per line.

    Stamps are read as decimals: a float of today's seconds is 0.2 microseconds coarse.

    Raises:
        RecordingError: it cannot be read, or is no such file.
    """
    text = read_text(path, "trajectory", RecordingError)
    try:
        lines = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
        if any(len(words) != _COLUMNS for words in lines):
            raise ValueError(f"expected {_COLUMNS} numbers per line")
        stamps = np.array([int((Decimal(words[0]) * _NANOSECONDS).to_integral_value()) for words in lines], np.int64)
        rows = np.array([[float(word) for word in words[1:]] for words in lines])
        if len(rows) < 2 or not np.isfinite(rows).all() or not (np.diff(stamps) > 0).all():
            raise ValueError("expected two lines or more, finite, with increasing stamps")
        return stamps, rigid(rotation_from_xyzw(rows[:, 3:]), rows[:, :3])
    except (ValueError, DecimalException, OverflowError) as error:
        raise RecordingError(f"{path}: cannot be read as a trajectory in TUM format: {_told(error)}") from error


def captured_tum(path: Path) -> CapturedMotion:
    """The bodies of a TUM file, or of all ``*.tum`` in a folder: each is named after its file.

    All are brought to the stamps of the first; where one is not known its point is NaN.

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


def _told(error: Exception) -> str:
    """What an error says, but not the whole of a damaged line, which it may quote."""
    text = str(error)
    return text if len(text) <= _LONGEST_TOLD else f"{text[:_LONGEST_TOLD]}..."
