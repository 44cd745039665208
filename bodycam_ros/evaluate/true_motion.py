"""The true motion of a recording, to score against."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.formats.tum import read_tum
from bodycam_ros.geometry import Array
from bodycam_ros.results.body_motion import interpolated
from bodycam_ros.yaml_file import read_yaml

_TRUTH = "truth"
_EDGE_NS = 1000
"""A stamp this far outside counts as the first or the last frame's: stamps are rounded on their way."""


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """True poses of the segments over K frames.

    Attributes:
        path: of the folder that holds them.
        stamps_ns: (K,) increasing [ns].
        root: the segment without a parent.
        parents: segment -> its parent, of segments that carry a camera or lie between such.
        world_T_segment: segment -> (K, 4, 4) [m], z up; may hold more segments, such as hands.
    """

    path: Path
    stamps_ns: NDArray[np.int64]
    root: str
    parents: Mapping[str, str]
    world_T_segment: Mapping[str, Array]

    @property
    def recording(self) -> str:
        """Name of the recording: of the folder that the truth lies in."""
        folder = self.path.resolve()
        return folder.parent.name if folder.name == _TRUTH else folder.name

    @property
    def frame_ns(self) -> float:
        """Median time between two frames [ns]."""
        return float(np.median(np.diff(self.stamps_ns)))

    def covers(self, stamps_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(T,) whether the truth is known at stamps (T,) [ns]."""
        first_ns, last_ns = self.stamps_ns[0] - _EDGE_NS, self.stamps_ns[-1] + _EDGE_NS
        covered: NDArray[np.bool_] = (stamps_ns >= first_ns) & (stamps_ns <= last_ns)
        return covered

    def at(self, stamps_ns: NDArray[np.int64], segment: str) -> Array:
        """Poses (T, 4, 4) of a segment at stamps (T,) that the truth covers [ns]."""
        return interpolated(self.stamps_ns, self.world_T_segment[segment], stamps_ns)


def read_true_motion(path: Path) -> TrueMotion:
    """Read ``truth/segments/*.tum`` of a recording and the tree of segments in its ``rig.yaml``.

    Args:
        path: the recording's folder, or its folder ``truth``.

    Raises:
        RecordingError: a folder or file is missing or malformed.
    """
    truth = path / _TRUTH if (path / _TRUTH).is_dir() else path
    files = sorted((truth / "segments").glob("*.tum"))
    if not files:
        raise RecordingError(f"{path}: no ground truth; expected segments/*.tum in it or in its folder truth")
    root, parents = _tree(truth)
    trajectories = {file.stem: read_tum(file) for file in files}
    if not {root, *parents} & set(trajectories):
        raise RecordingError(f"{truth / 'segments'}: none of its files is named as a segment of rig.yaml")
    stamps_ns = next(iter(trajectories.values()))[0]
    for segment, (stamps, _) in trajectories.items():
        if not np.array_equal(stamps, stamps_ns):
            raise RecordingError(f"{truth / 'segments'}: {segment}.tum has other stamps than the first file")
    return TrueMotion(truth, stamps_ns, root, parents, {segment: poses for segment, (_, poses) in trajectories.items()})


def _tree(truth: Path) -> tuple[str, dict[str, str]]:
    """The topmost segment, and segment -> parent of all others."""
    path = next(
        (folder / "rig.yaml" for folder in (truth, truth.resolve().parent) if (folder / "rig.yaml").is_file()), None
    )
    if path is None:
        raise RecordingError(f"{truth}: no rig.yaml in it or beside it, with the parent of each segment")
    document = read_yaml(path, "rig file", RecordingError)
    try:
        segments = dict(document["segments"])
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{path}: expected a table segments, segment -> parent") from error
    roots = [segment for segment, parent in segments.items() if not parent]
    if len(roots) != 1:
        raise RecordingError(
            f"{path}: one segment has no parent (null), not {len(roots)}: {', '.join(map(str, roots))}"
        )
    return str(roots[0]), {str(segment): str(parent) for segment, parent in segments.items() if parent}
