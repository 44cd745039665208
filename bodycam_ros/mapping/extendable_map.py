"""A reference map with spare slots for landmarks that body cameras add and remove while it is in use.

Slots exist from the start. A landmark of size zero is never visible, so computations over the whole map include the
empty slots without effect, arrays keep their length, and memory is bounded.
"""

from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import MapError
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.visual_index import VisualIndex
from bodycam_ros.tracking.track_frame import DESCRIPTOR_LENGTH, NO_LANDMARK, find_rows

VIEWS = 2
"""Descriptors that an added landmark keeps, from directions far from each other."""

GREY = 128
"""Colour of landmarks from grey images."""


ADDED = np.dtype(
    [
        ("slot", "i8"),
        ("landmark_id", "u4"),  # NO_LANDMARK: the slot is empty from now on
        ("point_world", "f8", 3),  # [m]
        ("descriptors", "u1", (VIEWS, DESCRIPTOR_LENGTH)),  # RootSIFT
        ("views", "f4", (VIEWS, 3)),  # unit directions from the landmark to the cameras of the descriptors
        ("sizes", "f4", VIEWS),  # as ``ReferenceMap.descriptor_size``; 0 where there is no descriptor
    ]
)
"""A landmark that was added, refined or removed."""

AddedLandmarks = NDArray[np.void]
"""(M,) of ``ADDED``."""


def empty_slots(slots: NDArray[np.int64]) -> AddedLandmarks:
    """Slots (M,) without landmarks."""
    added = np.zeros(len(slots), ADDED)
    added["slot"], added["landmark_id"] = slots, NO_LANDMARK
    return added


@dataclass(frozen=True)
class ExtendableMap(ReferenceMap):
    """A map whose last landmarks come and go; see ``make_extendable``.

    Attributes:
        slots_from: row of the first slot.
        first_id: ids from here on are those of slots: the id minus ``first_id``, modulo the capacity, is the slot.
        update_count: (1,) how often the slots were written.
    """

    slots_from: int = 0
    first_id: int = 0
    update_count: NDArray[np.int64] = field(default_factory=lambda: np.zeros(1, np.int64))

    @property
    def changes(self) -> int:
        """How often landmarks were added or removed."""
        return int(self.update_count[0])

    @property
    def capacity(self) -> int:
        """Number of slots."""
        return len(self.landmark_ids) - self.slots_from

    @property
    def first_grown(self) -> int:
        """Row of the first landmark that body cameras added, in this run or before it."""
        return self.slots_from - self.grown

    @property
    def _first_slot_descriptor(self) -> int:
        return len(self.descriptor_landmark) - VIEWS * self.capacity

    @cached_property
    def visual_index(self) -> VisualIndex:
        """The index of all descriptors, for all cameras."""
        first = self._first_slot_descriptor
        index = VisualIndex(self.descriptors, self.descriptor_landmark, self.index_words(first))
        index.add(first + np.flatnonzero(self.descriptor_size[first:] > 0.0))
        return index

    @cached_property
    def _settled_by_id(self) -> NDArray[np.int64]:
        return np.argsort(self.landmark_ids[: self.slots_from], kind="stable")

    def rows_of(self, landmark_ids: NDArray[np.uint32]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Rows (N,) of landmarks, and whether each is in the map; rows of absent ones are meaningless."""
        rows, _ = find_rows(self.landmark_ids[: self.slots_from], landmark_ids, self._settled_by_id)
        ids = landmark_ids.astype(np.int64)
        in_slot = (ids >= self.first_id) & (landmark_ids != NO_LANDMARK)
        if self.capacity:
            rows = np.where(in_slot, self.slots_from + (ids - self.first_id) % self.capacity, rows)
        return rows, self.landmark_ids[rows] == landmark_ids

    def update(self, added: AddedLandmarks) -> None:
        """Write landmarks into their slots."""
        slots, sizes = added["slot"], added["sizes"]
        rows = self.slots_from + slots
        described = self._first_slot_descriptor + VIEWS * slots[:, None] + np.arange(VIEWS)
        self.landmark_ids[rows] = added["landmark_id"]
        self.points_world[rows] = added["point_world"]
        self.descriptors[described] = added["descriptors"]
        self.descriptor_view[described] = added["views"]
        self.descriptor_size[described] = sizes
        self.landmark_sizes[rows] = sizes.max(axis=1)
        self.update_count[0] += 1
        if "visual_index" in self.__dict__:  # else the index will be made of all landmarks, once a camera is lost
            self.visual_index.add(described[sizes > 0.0])

    def compact(self) -> ReferenceMap:
        """The map as it is now, for a file: without empty slots, ids of added landmarks numbered anew.

        Normals of added landmarks are zero, so direct registration ignores them; see ``LocalMapper.extended_map``.
        """
        filled = np.flatnonzero(self.landmark_ids[self.slots_from :] != NO_LANDMARK)
        rows = np.concatenate([np.arange(self.slots_from), self.slots_from + filled])
        first = self._first_slot_descriptor
        described = np.concatenate([np.arange(first), first + np.flatnonzero(self.descriptor_size[first:] > 0.0)])
        ids = np.concatenate([self.landmark_ids[: self.slots_from], self.first_id + np.arange(len(filled))])
        photographs = self.photographs
        if photographs is not None:
            normals = np.concatenate([photographs.normals, np.zeros((len(filled), 3), np.float32)])
            photographs = replace(photographs, normals=normals)
        changed: dict[str, Any] = {
            "landmark_ids": ids.astype(np.uint32),
            "points_world": self.points_world[rows],
            "colours": self.colours[rows],
            "descriptor_landmark": np.searchsorted(rows, self.descriptor_landmark[described]).astype(np.uint32),
            "descriptors": self.descriptors[described],
            "descriptor_view": self.descriptor_view[described],
            "descriptor_size": self.descriptor_size[described],
            "photographs": photographs,
            "grown": self.grown + len(filled),
            "words": None,
        }
        return ReferenceMap(**_fields_of(self) | changed)


def _fields_of(reference_map: ReferenceMap) -> dict[str, Any]:
    return {each.name: getattr(reference_map, each.name) for each in fields(ReferenceMap)}


def make_extendable(reference_map: ReferenceMap, capacity: int) -> ExtendableMap:
    """A copy of a map with ``capacity`` empty slots."""
    landmarks = len(reference_map.landmark_ids)
    empty = empty_slots(np.arange(capacity))
    spare = {
        "landmark_ids": empty["landmark_id"],
        "points_world": empty["point_world"],
        "colours": np.full((capacity, 3), GREY, np.uint8),
        "descriptor_landmark": np.repeat(np.arange(landmarks, landmarks + capacity, dtype=np.uint32), VIEWS),
        "descriptors": empty["descriptors"].reshape(-1, DESCRIPTOR_LENGTH),
        "descriptor_view": empty["views"].reshape(-1, 3),
        "descriptor_size": empty["sizes"].ravel(),
    }
    before = _fields_of(reference_map)
    return ExtendableMap(
        **before | {name: np.concatenate([before[name], more]) for name, more in spare.items()},
        slots_from=landmarks,
        first_id=int(reference_map.landmark_ids.max()) + 1,
    )


def load_added_landmarks(path: Path, reference_map: ReferenceMap, map_path: Path) -> AddedLandmarks:
    """The landmarks of a saved map that its reference map does not have, each with its first descriptors.

    Args:
        path: folder of the saved map.
        reference_map: the map that it must extend.
        map_path: folder of that map, for messages.

    Raises:
        MapError: the saved map is damaged, or extends another map.
    """
    saved, settled = ReferenceMap.load(path), len(reference_map.landmark_ids)
    # A landmark that was triangulated anew is another one, whatever its id.
    same = np.array_equal(saved.landmark_ids[:settled], reference_map.landmark_ids) and np.array_equal(
        saved.points_world[:settled], reference_map.points_world
    )
    if not same:
        raise MapError(
            f"{path}: this map extends another one than {map_path}; give the map that it extends, or another folder "
            "for added landmarks, or remove this one"
        )
    added = empty_slots(np.arange(len(saved.landmark_ids) - settled))
    added["landmark_id"], added["point_world"] = saved.landmark_ids[settled:], saved.points_world[settled:]
    landmark = saved.descriptor_landmark.astype(np.int64)
    which = np.arange(len(landmark)) - np.searchsorted(landmark, landmark)
    kept = np.flatnonzero((landmark >= settled) & (which < VIEWS))
    places = landmark[kept] - settled, which[kept]
    added["descriptors"][places] = saved.descriptors[kept]
    added["views"][places] = saved.descriptor_view[kept]
    added["sizes"][places] = saved.descriptor_size[kept]
    return added
