"""What a static camera says of a body's segments when its images are looked at elsewhere: live, in its own process."""

from collections.abc import Mapping
from dataclasses import dataclass

from bodycam_ros.estimation.camera_evidence import SegmentPose


@dataclass(frozen=True, eq=False)
class SaidSegments:
    """What a station says of one instant.

    Attributes:
        station: a static camera.
        stamp_ns: mid-exposure of its image's middle row [ns].
        evidence: condensed poses of the segments that it sees well enough, each once.
        confidence: segment -> share of its contour that tells where it is, of all that the station looked for.
    """

    station: str
    stamp_ns: int
    evidence: tuple[SegmentPose, ...]
    confidence: Mapping[str, float]

    @property
    def camera(self) -> str:
        """The station: it is a camera among others."""
        return self.station
