"""A point that keyframes have seen: a guess at first, a landmark once enough of them agree on it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.growth.triangulation import Rays
from bodycam_ros.growth.worn_keyframe import WornKeyframe
from bodycam_ros.tracking.keypoints import DESCRIPTOR_LENGTH

_MOST_SIGHTINGS = 10
"""Rays that a point keeps: those farthest from each other, which say most of where it is."""

NO_SLOT = -1

Looks = tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32]]
"""Descriptors, views and sizes, see ``GrownPoint.looks``."""


@dataclass(frozen=True)
class Sighting:
    """One feature of one keyframe: a ray, and what it looks like."""

    camera: str
    stamp_ns: int
    at_ns: int
    centre: NDArray[np.float64]
    direction: NDArray[np.float64]
    focal_length: float
    descriptor: NDArray[np.uint8]
    size: float


def sighting(keyframe: WornKeyframe, feature: int, at_ns: int) -> Sighting:
    """Feature number so-and-so of a keyframe, which was taken at a time that all cameras share [ns]."""
    world_T_camera = keyframe.world_T_camera
    return Sighting(
        camera=keyframe.camera,
        stamp_ns=keyframe.stamp_ns,
        at_ns=at_ns,
        centre=world_T_camera[:3, 3].copy(),
        direction=world_T_camera[:3, :3] @ keyframe.bearings[feature],
        focal_length=keyframe.focal_length,
        descriptor=keyframe.descriptors[feature].copy(),  # or all of the keyframe would stay
        size=float(keyframe.sizes[feature]),
    )


@dataclass
class GrownPoint:
    """A point and who saw it.

    Attributes:
        sightings: up to some, in order of time.
        seen_ns: when it was seen last, by the time that all cameras share [ns].
        position: (3,) where it is [m].
        slot: of the growing map; ``NO_SLOT`` until it is a landmark.
        landmark_id: its id in the map then.
        strikes: images in which it was wrong, less those in which it was right.
        right: images in which a track of it was where it should be.
        kept_looks: of a landmark of an earlier run. Its sightings are gone, so it moves no more.
    """

    sightings: list[Sighting]
    seen_ns: int
    position: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    slot: int = NO_SLOT
    landmark_id: int = 0
    strikes: int = 0
    right: int = 0
    kept_looks: Looks | None = None

    def see(self, one: Sighting) -> bool:
        """Somebody saw it; whether that is kept.

        An image is one witness, however many of its features show the point.
        """
        self.seen_ns = max(self.seen_ns, one.at_ns)
        if self.kept_looks is not None or self.is_seen_in(one):
            return False
        if len(self.sightings) >= _MOST_SIGHTINGS:
            directions = np.array([own.direction for own in self.sightings])
            cosines = np.tril(directions @ directions.T, -1)
            if (directions @ one.direction).max() >= cosines.max():
                return False
            del self.sightings[int(cosines.argmax()) // len(cosines)]
        self.sightings.append(one)
        return True

    def is_seen_in(self, one: Sighting) -> bool:
        """Whether it has a sighting in the same image."""
        return any(own.stamp_ns == one.stamp_ns and own.camera == one.camera for own in self.sightings)

    def looks(self, count: int) -> Looks:
        """What it looks like from the sides farthest from each other, the nearest sighting first.

        Args:
            count: how many sides.

        Returns:
            Descriptors (count, 128); unit directions (count, 3) to where they were seen from; their sizes (count,) as
            ``ReferenceMap.descriptor_size``. A point that was seen less often says the same twice.
        """
        if self.kept_looks is not None:
            return self.kept_looks
        descriptors = np.zeros((count, DESCRIPTOR_LENGTH), np.uint8)
        views, sizes = np.zeros((count, 3), np.float32), np.zeros(count, np.float32)
        towards = np.array([s.centre for s in self.sightings]) - self.position
        distances = np.linalg.norm(towards, axis=1)
        towards /= distances[:, None]
        which = int(distances.argmin())
        cosines = np.full(len(towards), -np.inf)
        for row in range(count):
            chosen = self.sightings[which]
            descriptors[row], views[row] = chosen.descriptor, towards[which]
            sizes[row] = chosen.size * distances[which]
            cosines = np.maximum(cosines, towards @ towards[which])
            which = int(cosines.argmin())
        return descriptors, views, sizes


def rays_of(points: Sequence[GrownPoint]) -> Rays:
    """The rays to points."""
    shape = len(points), max(len(point.sightings) for point in points)
    centres, directions, focal_lengths = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.ones(shape)
    there = np.zeros(shape, bool)
    directions[:, :, 2] = 1.0
    for row, point in enumerate(points):
        for column, one in enumerate(point.sightings):
            centres[row, column], directions[row, column] = one.centre, one.direction
            focal_lengths[row, column], there[row, column] = one.focal_length, True
    return Rays(centres, directions, focal_lengths, there)
