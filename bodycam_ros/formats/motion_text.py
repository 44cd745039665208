"""Text files of motions: as long as a recording is, and times that must increase."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.yaml_file import read_text

_MOST_BYTES = 1_000_000_000
"""An hour of 100 markers at 100 Hz has 0.9 GB."""


def read_motion_text(path: Path, kind: str) -> str:
    """The text of a file.

    Raises:
        RecordingError: it cannot be read, or is larger than motions are.
    """
    return read_text(path, f"{kind} file", RecordingError, _MOST_BYTES)


def checked_stamps(seconds: Array) -> NDArray[np.int64]:
    """Stamps (K,) [ns] of times (K,) [s].

    Raises:
        ValueError: there are fewer than two, or they do not increase.
    """
    if len(seconds) < 2 or not np.isfinite(seconds).all():
        raise ValueError("expected two frames or more, each with its time")
    stamps_ns = np.rint(1e9 * seconds).astype(np.int64)
    if not (np.diff(stamps_ns) > 0).all():
        frame = int(np.argmin(np.diff(stamps_ns) > 0)) + 2
        raise ValueError(f"frame {frame} is not later than the one before it")
    return stamps_ns
