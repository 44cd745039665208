"""What static cameras said of the segments, over the images of a solved recording."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.segment_poses import segment_poses


@dataclass(frozen=True, eq=False)
class StationRecord:
    """One static camera over K images.

    Attributes:
        station: name.
        stamps_ns: (K,) of its images, increasing [ns].
        segments: (K,) how many it said something of.
        confidence: (K,) mean over the segments that it looked for, 0 to 1; 0 where it looked for none.
    """

    station: str
    stamps_ns: NDArray[np.int64]
    segments: NDArray[np.int64]
    confidence: Array

    @property
    def sees(self) -> NDArray[np.bool_]:
        """(K,) whether it said something of any segment."""
        seen: NDArray[np.bool_] = self.segments > 0
        return seen


class StationLog:
    """Messages of static cameras, on their way to records."""

    def __init__(self) -> None:
        self._said: dict[str, dict[int, tuple[int, float]]] = defaultdict(dict)

    def add(self, message: Message) -> None:
        """Take a bodycam_msgs/SegmentPoses.

        Raises:
            ValueError: it contradicts itself.
        """
        said = segment_poses(message)
        shares = list(said.confidence.values())
        self._said[said.station][said.stamp_ns] = len(said.evidence), float(np.mean(shares)) if shares else 0.0

    def records(self) -> tuple[StationRecord, ...]:
        """What each said, in the order of their names."""
        return tuple(
            StationRecord(
                station,
                np.array(sorted(said), dtype=np.int64),
                np.array([said[stamp][0] for stamp in sorted(said)], dtype=np.int64),
                np.array([said[stamp][1] for stamp in sorted(said)], dtype=np.float64),
            )
            for station, said in sorted(self._said.items())
        )
