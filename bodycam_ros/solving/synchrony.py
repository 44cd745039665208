"""Whether the cameras see the same instants: what each is off by, and on how many instants it speaks."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bodycam_ros.solving.body_frame import BodyFrame

_REMEMBERED = 150
"""Instants: some seconds, enough for a median, and forgotten soon when a camera is mended."""


@dataclass(frozen=True)
class Timing:
    """How one camera goes with the others.

    Attributes:
        share: share of the others' instants at which it speaks, 0 to 1.
        offset_ms: median of its stamps minus those of the others' nearest instant; NaN while it says nothing.
        spread_ms: how far that wanders: from its 5th to its 95th percentile; large where a camera is free-running.
    """

    share: float
    offset_ms: float
    spread_ms: float


class Synchrony:
    """Remembers the latest instants of all cameras.

    Args:
        cameras: their names.
    """

    def __init__(self, cameras: Iterable[str]) -> None:
        self._cameras = list(cameras)
        self._frames: deque[dict[str, int]] = deque(maxlen=_REMEMBERED)

    def join(self, camera: str) -> None:
        """One more camera."""
        self._cameras.append(camera)

    def add(self, frame: BodyFrame) -> None:
        """Note who speaks of an instant."""
        self._frames.append({camera: matches.stamp_ns for camera, matches in frame.matches.items()})

    def timings(self) -> dict[str, Timing]:
        """Camera -> how it goes with the others lately; empty before the first instant."""
        if not self._frames:
            return {}
        # The camera that is most in company says what the others' instants are.
        company = {camera: sum(len(f) for f in self._frames if camera in f) for camera in self._cameras}
        reference = max(self._cameras, key=lambda camera: company[camera])
        instants = [frame for frame in self._frames if reference in frame]
        reference_ns = np.sort([frame[reference] for frame in instants])
        return {
            camera: self._timing(camera, reference_ns, sum(camera in frame for frame in instants) / len(instants))
            for camera in self._cameras
        }

    def _timing(self, camera: str, reference_ns: "np.ndarray[tuple[int], np.dtype[np.int64]]", share: float) -> Timing:
        stamps_ns = np.array([frame[camera] for frame in self._frames if camera in frame], np.int64)
        if not len(stamps_ns):
            return Timing(share, float("nan"), float("nan"))
        after = np.searchsorted(reference_ns, stamps_ns)
        before_ns = reference_ns[np.maximum(after - 1, 0)]
        after_ns = reference_ns[np.minimum(after, len(reference_ns) - 1)]
        nearest_ns = np.where(stamps_ns - before_ns < after_ns - stamps_ns, before_ns, after_ns)
        # At the ends there is an instant on one side only.
        nearest_ns = np.where(after == len(reference_ns), before_ns, nearest_ns)
        offsets_ms = 1e-6 * (stamps_ns - nearest_ns)
        low, median, high = np.percentile(offsets_ms, [5, 50, 95])
        return Timing(share, float(median), float(high - low))
