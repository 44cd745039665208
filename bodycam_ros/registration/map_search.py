"""How a map is asked what a picture shows, by descriptors alone: similar places, and an index of all landmarks.

Made when a camera is lost for the first time; all cameras of a process share it.

An inverted file (Sivic and Zisserman 2003): looks are listed by their visual word, and a descriptor is compared with
those in the few lists that are most like it, byte by byte.

The vector is a VLAD (Jegou et al. 2010): of every visual word, the mean direction in which the descriptors of that word
deviate from it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import as_bytes, as_rows
from bodycam_ros.registration.descriptor_kernels import FARTHEST, givers_of_looks, search_lists
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.visual_words import VisualWords

_SORTED_IN_ABOVE = 4096  # of looks that came later
_SORTED_IN_SHARE = 4


@dataclass(frozen=True)
class _Lists:
    """Looks (N,) list by list, and where each list begins (W + 1,)."""

    looks: NDArray[np.int64]
    first: NDArray[np.int64]

    @classmethod
    def of(cls, looks: NDArray[np.int64], lists: NDArray[np.integer], count: int) -> "_Lists":
        order = np.argsort(lists, kind="stable")
        return cls(looks[order], np.searchsorted(lists[order], np.arange(count + 1)).astype(np.int64))


class LandmarkIndex:
    """Looks of landmarks by their words.

    Args:
        words: whose lists they are in.
        descriptors: (D, 128) uint8 table of all looks; the index reads it at every search.
        landmark_of_look: (D,) uint32 their landmarks.
    """

    def __init__(
        self,
        words: VisualWords,
        descriptors: NDArray[np.uint8],
        landmark_of_look: NDArray[np.uint32],
    ) -> None:
        self._words = words
        self._descriptors = as_bytes(descriptors)
        self._landmark_of_look = np.require(landmark_of_look, np.uint32, ("C", "A", "W", "E"))
        self._list_of_look = np.zeros(len(descriptors), np.int32)
        self._is_sorted, self._is_later = np.zeros((2, len(descriptors)), bool)
        self._sorted = self._later = self._lists_of(self._is_sorted)
        self._changed = False

    def add(self, looks: NDArray[np.int64], words: NDArray[np.int64] | None = None) -> None:
        """List looks of the table, those that it has gained or whose descriptors are others by now.

        Args:
            looks: (N,) their rows.
            words: (N,) of their descriptors, where they are known.
        """
        descriptors = self._descriptors[looks]
        words = self._words.words_of(descriptors) if words is None else words
        self._list_of_look[looks] = self._words.list_of(descriptors, words)
        self._is_later[looks] = True
        self._changed = True

    def nearest(
        self, descriptors: NDArray[np.uint8], lists: int, among: NDArray[np.int64] | None = None
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """The landmark that is most like each descriptor, of those in some lists.

        Args:
            descriptors: (M, 128) uint8.
            lists: how many are searched for each descriptor.
            among: (N,) rows of the looks that are asked for; None: all.

        Returns:
            Rows (M,) of landmarks, -1 where there is none, and the distances (M,) to each and to the next one; those
            of nobody are beyond all others.
        """
        parts = self._all() if among is None else (_Lists.of(among, self._list_of_look[among], self._words.lists),)
        count = len(descriptors)
        landmarks, best, rival = np.full(count, -1), np.full(count, FARTHEST), np.full(count, FARTHEST)
        probed = self._words.lists_near(descriptors, lists)
        for part in parts:
            search_lists(
                as_bytes(descriptors),
                probed,
                part.first,
                part.looks,
                self._descriptors,
                self._landmark_of_look,
                landmarks,
                best,
                rival,
            )
        return landmarks, np.sqrt(best), np.sqrt(rival)

    def _all(self) -> "tuple[_Lists, ...]":
        """All looks: those that were there when they were sorted last, and those that came later, or came anew."""
        if self._changed:
            self._changed = False
            self._later = self._lists_of(self._is_later)
            if len(self._later.looks) > max(_SORTED_IN_ABOVE, len(self._sorted.looks) // _SORTED_IN_SHARE):
                self._is_sorted |= self._is_later
                self._is_later[:] = False
                self._sorted, self._later = self._lists_of(self._is_sorted), self._lists_of(self._is_later)
        return self._sorted, self._later

    def _lists_of(self, listed: NDArray[np.bool_]) -> _Lists:
        looks = np.flatnonzero(listed)
        return _Lists.of(looks, self._list_of_look[looks], self._words.lists)


Vectors = NDArray[np.float32]

_ROOM = 64  # for places, at first


class PlaceMemory:
    """Places, each by a vector and by the landmarks that are seen there.

    Args:
        words: by which places are compared.
    """

    def __init__(self, words: VisualWords) -> None:
        self._words = words
        self._vectors = np.zeros((_ROOM, words.centres.size), np.float32)
        self._landmarks: list[NDArray[np.int64]] = []

    def __len__(self) -> int:
        return len(self._landmarks)

    def add(
        self, descriptors: NDArray[np.uint8], landmarks: NDArray[np.int64], words: NDArray[np.int64] | None = None
    ) -> None:
        """One more place.

        Args:
            descriptors: (M, 128) uint8 of what is seen there.
            landmarks: (N,) rows of the landmarks that are.
            words: (M,) of the descriptors, where they are known.
        """
        place = len(self)
        if place == len(self._vectors):
            self._vectors = np.concatenate([self._vectors, np.zeros_like(self._vectors)])
        self._vectors[place] = self._vector(descriptors, self._words.words_of(descriptors) if words is None else words)
        self._landmarks.append(landmarks)

    def similar(self, descriptors: NDArray[np.uint8], count: int) -> NDArray[np.int64]:
        """(N,) the places most like what shows these descriptors (M, 128), the most alike first; ``count`` at most."""
        likeness = self._vectors[: len(self)] @ self._vector(descriptors, self._words.words_of(descriptors))
        return np.argsort(-likeness, kind="stable")[:count]

    def seen_from(self, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows (N,), ascending, of the landmarks that are seen from any of these places (M,)."""
        return np.unique(np.concatenate([np.zeros(0, np.int64), *(self._landmarks[p] for p in places.tolist())]))

    def _vector(self, descriptors: NDArray[np.uint8], words: NDArray[np.int64]) -> Vectors:
        centres = self._words.centres
        members = np.zeros((len(centres), len(words)), np.float32)
        members[words, np.arange(len(words))] = 1.0
        deviations = members @ descriptors.astype(np.float32) - members.sum(axis=1, keepdims=True) * centres
        lengths = np.linalg.norm(deviations, axis=1, keepdims=True)
        vector = (deviations / np.maximum(lengths, 1e-9)).ravel()
        return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-9), np.float32)


class MapSearch:
    """Places and index of a map; the index may be added to.

    Args:
        points_world: (L, 3) its landmarks [m].
        descriptors, landmark_of_look, sides: (D, 128), (D,), (D, 3) its looks, see ``ReferenceMap``.
        looks: how many of them are there by now; the others are added to the index when they come.
        world_T_camera: (K, 4, 4) poses of its photographs.
        photographs: which landmarks they show; None: those that they gave looks of. No picture is needed.

    Attributes:
        places: those of the photographs, in their order, and those that were added.
        index: of all looks.
    """

    def __init__(
        self,
        points_world: NDArray[np.float64],
        descriptors: NDArray[np.uint8],
        landmark_of_look: NDArray[np.uint32],
        sides: NDArray[np.float32],
        looks: int,
        world_T_camera: NDArray[np.float64],
        photographs: MapPhotographs | None,
    ) -> None:
        words = VisualWords.learn(descriptors[:looks])
        word_of_look = words.words_of(descriptors[:looks])
        self.index = LandmarkIndex(words, descriptors, landmark_of_look)
        self.index.add(np.arange(looks), word_of_look)
        self.places = PlaceMemory(words)
        landmarks = landmark_of_look[:looks].astype(np.int64)
        first, observers = np.zeros(0, np.int64), np.zeros(0, np.int64)
        if photographs is not None:
            first, observers = photographs.first_observation, photographs.observation_view.astype(np.int64)
        centres = as_rows(world_T_camera[:, :3, 3])
        givers = givers_of_looks(as_rows(points_world), landmarks, as_rows(sides[:looks]), centres, first, observers)
        looks_given = _grouped(givers, len(centres))
        shown = [np.unique(landmarks[given]) for given in looks_given]
        if photographs is not None:
            # A photograph shows more landmarks than it gave looks of.
            seen = photographs.observation_landmark.astype(np.int64)
            shown = [seen[rows] for rows in _grouped(observers, len(centres))]
        for given, of_place in zip(looks_given, shown, strict=True):
            self.places.add(descriptors[given], of_place, word_of_look[given])


def _grouped(group: NDArray[np.int64], groups: int) -> list[NDArray[np.int64]]:
    """For each group the rows that are of it."""
    order = np.argsort(group, kind="stable")
    ends = np.searchsorted(group[order], np.arange(groups + 1))
    return np.split(order, ends)[1:-1]
