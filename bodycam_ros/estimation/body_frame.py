"""What all cameras together say about one instant."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from bodycam_ros.body_state import SaidSegments
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.registration.landmark_matches import LandmarkMatches


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
