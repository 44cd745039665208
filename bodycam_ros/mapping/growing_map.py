"""A reference map with room behind its landmarks for those that worn cameras add while it is in use.

Slots are there from the start, empty: who computes over the whole map computes over them too, and passes them by,
because a landmark without size is too small to be seen by anybody. So arrays keep their length, and memory is bounded.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.worn_keyframe import Rays, WornKeyframe
from bodycam_ros.registration.map_search import MapSearch
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.keypoints import DESCRIPTOR_LENGTH
from bodycam_ros.tracking.track_frame import NO_LANDMARK

LOOKS = 2
"""Descriptors that a grown landmark keeps."""

GREY = 128
"""Colour of landmarks that grey images gave."""


@dataclass(frozen=True)
class GrownLandmarks:
    """Landmarks that are new, or better known, or gone.

    Attributes:
        slots: (M,) which of the slots they take.
        landmark_ids: (M,) uint32; ``NO_LANDMARK``: the slot is empty from now on.
        points_world: (M, 3) [m].
        descriptors: (M, LOOKS, 128) uint8 RootSIFT.
        views: (M, LOOKS, 3) float32 unit directions from the landmark to the cameras that gave them.
        sizes: (M, LOOKS) float32 as ``ReferenceMap.descriptor_size``; 0 where there is no descriptor.
    """

    slots: NDArray[np.int64]
    landmark_ids: NDArray[np.uint32]
    points_world: NDArray[np.float64]
    descriptors: NDArray[np.uint8]
    views: NDArray[np.float32]
    sizes: NDArray[np.float32]


@dataclass(frozen=True)
class GrowingMap(ReferenceMap):
    """A map whose last landmarks come and go; see ``growing``.

    Attributes:
        slots_from: row of the first slot.
        first_id: ids from here on are those of slots; an id says which slot, and for the how-manieth time.
    """

    slots_from: int = 0
    first_id: int = 0

    @property
    def capacity(self) -> int:
        """Number of slots."""
        return len(self.landmark_ids) - self.slots_from

    @property
    def first_grown(self) -> int:
        """Row of the first landmark that worn cameras gave, in this run or before it."""
        return self.slots_from - self.grown

    @cached_property
    def search(self) -> MapSearch:
        """What the map is asked by descriptors alone, for all cameras."""
        settled = len(self.descriptor_landmark) - LOOKS * self.capacity
        search = self._search(settled)
        search.index.add(settled + np.flatnonzero(self.descriptor_size[settled:] > 0.0))
        return search

    @cached_property
    def _settled_by_id(self) -> NDArray[np.int64]:
        return np.argsort(self.landmark_ids[: self.slots_from], kind="stable")

    def rows_of(self, landmark_ids: NDArray[np.uint32]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Rows (N,) of landmarks, and whether the map has each; rows of those that it has not mean nothing."""
        settled = self.landmark_ids[: self.slots_from]
        at = np.searchsorted(settled, landmark_ids, sorter=self._settled_by_id)
        rows = self._settled_by_id[np.minimum(at, self.slots_from - 1)]
        ids = landmark_ids.astype(np.int64)
        in_slot = (ids >= self.first_id) & (landmark_ids != NO_LANDMARK)
        if self.capacity:
            rows = np.where(in_slot, self.slots_from + (ids - self.first_id) % self.capacity, rows)
        return rows, self.landmark_ids[rows] == landmark_ids

    def take(self, grown: GrownLandmarks) -> None:
        """Put landmarks into their slots."""
        rows = self.slots_from + grown.slots
        looks = len(self.descriptor_landmark) - LOOKS * self.capacity + LOOKS * grown.slots[:, None] + np.arange(LOOKS)
        sizes = np.where((grown.landmark_ids == NO_LANDMARK)[:, None], np.float32(0), grown.sizes)
        self.landmark_ids[rows] = grown.landmark_ids
        self.points_world[rows] = grown.points_world
        self.descriptors[looks] = np.where(sizes[:, :, None] > 0, grown.descriptors, 0)
        self.descriptor_view[looks] = grown.views
        self.descriptor_size[looks] = sizes
        self.landmark_sizes[rows] = sizes.max(axis=1)
        self.grid.put(rows)
        if "search" in self.__dict__:  # else nobody has been lost yet, and it will be made of all that is there
            self.search.index.add(looks[sizes > 0.0])

    def settled(self) -> ReferenceMap:
        """The map as it is now, for a file: what fills the slots behind the others, numbered anew, and no empty slots.

        No photograph shows what has grown, and its normals are zero: whoever looks by photographs passes it by.
        """
        filled = np.flatnonzero(self.landmark_ids[self.slots_from :] != NO_LANDMARK)
        rows = np.concatenate([np.arange(self.slots_from), self.slots_from + filled])
        first_look = len(self.descriptor_landmark) - LOOKS * self.capacity
        there = first_look + np.flatnonzero(self.descriptor_size[first_look:] > 0.0)
        looks = np.concatenate([np.arange(first_look), there])
        ids = np.concatenate([self.landmark_ids[: self.slots_from], self.first_id + np.arange(len(filled))])
        photographs = self.photographs
        if photographs is not None:
            nowhere = np.zeros((len(filled), 3), np.float32)
            photographs = replace(photographs, normals=np.concatenate([photographs.normals, nowhere]))
        settled = {f.name: getattr(self, f.name) for f in fields(ReferenceMap)}
        return ReferenceMap(
            **settled
            | {
                "landmark_ids": ids.astype(np.uint32),
                "points_world": self.points_world[rows],
                "colours": self.colours[rows],
                "descriptor_landmark": np.searchsorted(rows, self.descriptor_landmark[looks]).astype(np.uint32),
                "descriptors": self.descriptors[looks],
                "descriptor_view": self.descriptor_view[looks],
                "descriptor_size": self.descriptor_size[looks],
                "photographs": photographs,
                "grown": self.grown + len(filled),
            }
        )


def growing(reference_map: ReferenceMap, capacity: int) -> GrowingMap:
    """A map with room for so many landmarks; the given one stays as it is."""
    landmarks = len(reference_map.landmark_ids)
    rows = np.arange(landmarks, landmarks + capacity, dtype=np.uint32)
    spare = {
        "landmark_ids": np.full(capacity, NO_LANDMARK, np.uint32),
        "points_world": np.zeros((capacity, 3)),
        "colours": np.full((capacity, 3), GREY, np.uint8),
        "descriptor_landmark": np.repeat(rows, LOOKS),
        "descriptors": np.zeros((LOOKS * capacity, DESCRIPTOR_LENGTH), np.uint8),
        "descriptor_view": np.zeros((LOOKS * capacity, 3), np.float32),
        "descriptor_size": np.zeros(LOOKS * capacity, np.float32),
    }
    settled = {f.name: getattr(reference_map, f.name) for f in fields(ReferenceMap)}
    return GrowingMap(
        **settled | {name: np.concatenate([settled[name], more]) for name, more in spare.items()},
        slots_from=landmarks,
        first_id=int(reference_map.landmark_ids.max()) + 1,
    )


def load_growth(path: Path, reference_map: ReferenceMap, map_path: Path) -> GrownLandmarks:
    """The landmarks of a saved map that its reference map has not.

    Args:
        path: folder of the saved map.
        reference_map: what it must have grown from.
        map_path: its folder, for messages.

    Raises:
        MapError: the saved map is damaged, or has grown from another one.
    """
    saved, settled = ReferenceMap.load(path), len(reference_map.landmark_ids)
    # A landmark that was placed anew is another one, whatever its id.
    same = np.array_equal(saved.landmark_ids[:settled], reference_map.landmark_ids) and np.array_equal(
        saved.points_world[:settled], reference_map.points_world
    )
    if not same:
        raise MapError(
            f"{path}: this map has grown from another one than {map_path}; give the map that it has grown from, or "
            "another folder for what grows, or remove this one"
        )
    return _behind(saved, settled)


def _behind(saved: ReferenceMap, settled: int) -> GrownLandmarks:
    """The landmarks from a row on, each with its first looks."""
    count = len(saved.landmark_ids) - settled
    landmark = saved.descriptor_landmark.astype(np.int64)
    which = np.arange(len(landmark)) - np.searchsorted(landmark, landmark)
    looks = np.flatnonzero((landmark >= settled) & (which < LOOKS))
    at = landmark[looks] - settled, which[looks]
    descriptors = np.zeros((count, LOOKS, DESCRIPTOR_LENGTH), np.uint8)
    views, sizes = np.zeros((count, LOOKS, 3), np.float32), np.zeros((count, LOOKS), np.float32)
    descriptors[at], views[at], sizes[at] = (
        saved.descriptors[looks],
        saved.descriptor_view[looks],
        saved.descriptor_size[looks],
    )
    points, ids = saved.points_world[settled:].copy(), saved.landmark_ids[settled:].copy()
    return GrownLandmarks(np.arange(count), ids, points, descriptors, views, sizes)


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
