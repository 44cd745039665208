"""An index of all landmarks by what they look like: which of them is like a descriptor, at a cost that hardly grows.

An inverted file (Sivic and Zisserman 2003): looks are listed by their visual word, and a descriptor is compared with
those in the few lists that are most like it, byte by byte.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import as_bytes
from bodycam_ros.registration.descriptor_kernels import FARTHEST, search_lists
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
