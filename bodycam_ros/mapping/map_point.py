"""A point that body cameras observe, with the rays to it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array
from bodycam_ros.mapping.body_keyframe import BodyKeyframe
from bodycam_ros.mapping.triangulation import Triangulation, spread_directions, triangulate

_MAX_SIGHTINGS = 10  # rays that a point keeps: those farthest from each other, which constrain it most

NO_SLOT, REMOVED = -1, -2

Descriptors = tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32]]
"""Descriptors (N, 128); unit directions (N, 3) to their cameras; sizes (N,) as ``ReferenceMap.descriptor_size``."""


@dataclass(frozen=True)
class Sighting:
    """One feature of one keyframe: a ray and its descriptor."""

    camera: str
    stamp_ns: int
    centre: Array
    direction: Array
    focal_px: float
    descriptor: NDArray[np.uint8]
    size: float


def make_sighting(keyframe: BodyKeyframe, feature: int) -> Sighting:
    """The sighting of a keyframe's feature, by its row."""
    return Sighting(
        camera=keyframe.camera,
        stamp_ns=keyframe.stamp_ns,
        centre=keyframe.world_T_camera[:3, 3].copy(),
        direction=keyframe.rays_world[feature].copy(),  # a view would keep all of the keyframe
        focal_px=keyframe.focal_length,
        descriptor=keyframe.descriptors[feature].copy(),
        size=float(keyframe.sizes[feature]),
    )


@dataclass(eq=False)
class MapPoint:
    """A point and its sightings.

    Attributes:
        sightings: up to some, in order of time.
        position: (3,) [m].
        slot: of the extendable map; ``NO_SLOT`` until it is a landmark, ``REMOVED`` once it is none any more.
        landmark_id: its id in the map then.
        strikes: images in which it was an outlier, minus those in which it was an inlier.
        saved: descriptors of a landmark of an earlier run, which has no sightings and is never refined.
    """

    sightings: list[Sighting] = field(default_factory=list)
    position: Array = field(default_factory=lambda: np.zeros(3))
    slot: int = NO_SLOT
    landmark_id: int = 0
    strikes: int = 0
    saved: Descriptors | None = None

    def add(self, sighting: Sighting) -> bool:
        """Add a sighting; whether it is kept. An image counts once, however many of its features show the point."""
        image = sighting.camera, sighting.stamp_ns
        if self.saved is not None or any((own.camera, own.stamp_ns) == image for own in self.sightings):
            return False
        if len(self.sightings) >= _MAX_SIGHTINGS:
            directions = np.array([own.direction for own in self.sightings])
            cosines = np.tril(directions @ directions.T, -1)
            if (directions @ sighting.direction).max() >= cosines.max():
                return False
            del self.sightings[int(cosines.argmax()) // len(cosines)]
        self.sightings.append(sighting)
        return True

    def descriptors(self, count: int) -> Descriptors:
        """``count`` descriptors from directions far from each other, the nearest sighting first."""
        if self.saved is not None:
            return self.saved
        towards = np.array([s.centre for s in self.sightings]) - self.position
        distances = np.linalg.norm(towards, axis=1)
        towards /= distances[:, None]
        order = np.argsort(distances, kind="stable")
        rows = order[spread_directions(towards[order], count)]
        chosen = [self.sightings[row] for row in rows.tolist()]
        sizes = distances[rows] * [s.size for s in chosen]
        return np.array([s.descriptor for s in chosen]), towards[rows].astype(np.float32), sizes.astype(np.float32)


def triangulate_points(points: Sequence[MapPoint]) -> Triangulation:
    """Triangulate points from their sightings."""
    shape = len(points), max(len(point.sightings) for point in points)
    centres, directions, focal_px = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape)
    directions[:, :, 2] = 1.0
    for row, point in enumerate(points):
        for column, one in enumerate(point.sightings):
            centres[row, column], directions[row, column] = one.centre, one.direction
            focal_px[row, column] = one.focal_px
    return triangulate(centres, directions, focal_px)
