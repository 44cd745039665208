"""A reference map with room behind its landmarks for those that worn cameras add while it is in use.

Slots are there from the start, empty: who computes over the whole map computes over them too, and passes them by,
because a landmark without size is too small to be seen by anybody. So arrays keep their length, and memory is bounded.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

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
