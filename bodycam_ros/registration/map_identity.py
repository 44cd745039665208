"""Which map it is: a hash of its landmarks, and of those that body cameras added."""

from dataclasses import dataclass
from hashlib import sha256

import numpy as np

from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.track_frame import NO_LANDMARK

_DIGITS = 16  # 64 bits: a coincidence among a million maps has a probability of 3e-8


@dataclass(frozen=True)
class MapIdentity:
    """Identity of a map, as text "9f86d081884c7d65" or, extended by body cameras, "9f86d081884c7d65+60303ae22b998861".

    Attributes:
        landmarks: hash of the landmarks of the photographs: numbers and places. They define the world frame.
        extension: hash of the landmarks that body cameras added; empty without any.
    """

    landmarks: str
    extension: str = ""

    def __str__(self) -> str:
        return f"{self.landmarks}+{self.extension}" if self.extension else self.landmarks

    @classmethod
    def parse(cls, text: str) -> "MapIdentity":
        """Read the text of an identity."""
        landmarks, _, extension = text.partition("+")
        return cls(landmarks, extension)

    def shares_world(self, other: "MapIdentity") -> bool:
        """Whether poses in one map are poses in the other: one may extend the other."""
        return self.landmarks == other.landmarks

    def contradicts(self, other: "MapIdentity") -> bool:
        """Whether both maps are known, and poses in one are none in the other."""
        return bool(self.landmarks and other.landmarks) and not self.shares_world(other)


def map_identity(reference_map: ReferenceMap) -> MapIdentity:
    """Identity of a map as it is now; neither its folder nor its pictures count."""
    first, used = reference_map.first_grown, reference_map.landmark_ids != NO_LANDMARK
    extension = _hash_of(reference_map, slice(first, None)) if used[first:].any() else ""
    return MapIdentity(_hash_of(reference_map, slice(first)), extension)


def _hash_of(reference_map: ReferenceMap, rows: slice) -> str:
    ids, points = reference_map.landmark_ids[rows], reference_map.points_world[rows]
    used = ids != NO_LANDMARK
    content = sha256(np.ascontiguousarray(ids[used], "<u4").tobytes())
    content.update(np.ascontiguousarray(points[used], "<f8").tobytes())
    return content.hexdigest()[:_DIGITS]
