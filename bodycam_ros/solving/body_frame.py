"""What all cameras together say about one instant."""

from collections.abc import Mapping
from dataclasses import dataclass

from bodycam_ros.registration.landmark_matches import LandmarkMatches


@dataclass(frozen=True)
class BodyFrame:
    """The registrations of one instant.

    Attributes:
        stamp_ns: the instant [ns].
        matches: camera -> its registration; a camera that has nothing to say is absent.
    """

    stamp_ns: int
    matches: Mapping[str, LandmarkMatches]
