"""What all cameras together say about one instant."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.estimation.camera_evidence import SegmentPose
from bodycam_ros.registration.landmark_matches import LandmarkMatches


@dataclass(frozen=True, eq=False)
class SaidSegments:
    """What a station says of one instant whose image was looked at elsewhere: live, in a process of its own.

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


@dataclass(frozen=True)
class BodyFrame:
    """The registrations of one instant, and what static cameras saw or said of it.

    Attributes:
        stamp_ns: the instant [ns].
        matches: camera -> its registration; a camera that has nothing to say is absent.
        images: static camera -> its image.
        said: static camera -> what its image said, where it was looked at elsewhere.
    """

    stamp_ns: int
    matches: Mapping[str, LandmarkMatches]
    images: Mapping[str, CameraImage] = field(default_factory=dict)
    said: Mapping[str, SaidSegments] = field(default_factory=dict)
