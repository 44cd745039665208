"""Values over time, as the points of a curve."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.solved.solved_recording import GAP_FRAMES, SolvedRecording


def broken_at_gaps(solved: SolvedRecording, stamps_ns: NDArray[np.int64], values: Array) -> tuple[Array, Array]:
    """Times (N,) [s] and values (N, ...) of a curve (T, ...) at stamps (T,), with a NaN in each gap of time."""
    after = np.flatnonzero(np.diff(stamps_ns) > GAP_FRAMES * solved.frame_ns) + 1
    return np.insert(solved.seconds(stamps_ns), after, np.nan), np.insert(values, after, np.nan, axis=0)


def lone_marker(curve: tuple[Array, Array]) -> str:
    """A dot if the curve is one point, which no line would show."""
    return "o" if len(curve[0]) == 1 else ""
