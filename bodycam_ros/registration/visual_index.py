"""Search of a map by descriptors alone: an inverted file of visual words (Sivic and Zisserman 2003).

Descriptors are listed by their visual word, and a query is compared with those in the lists of the words nearest to it,
byte by byte.

``bodycam map`` makes the words once and saves them with the map; a map without them makes them when a camera is lost
for the first time. The same map always gives the same words.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import as_bytes
from bodycam_ros.registration.descriptor_kernels import search_lists
from bodycam_ros.tracking.track_frame import DESCRIPTOR_LENGTH

_DESCRIPTORS_PER_WORD = 80  # of a map; more make a search slower, fewer make it miss more
_MOST_WORDS = 2048
_BLOCK = 16384  # descriptors assigned together
_PROBED = 8  # lists searched for a descriptor; they contain 56 of the 60 landmarks that all lists give

Vectors = NDArray[np.float32]


@dataclass(frozen=True)
class VisualWords:
    """Visual words of a map.

    Attributes:
        centres: (W, 128) uint8 their descriptors.
        word_of_descriptor: (D,) uint16 the word nearest to each descriptor of the map.
    """

    centres: NDArray[np.uint8]
    word_of_descriptor: NDArray[np.uint16]

    def fit(self, descriptors: int) -> bool:
        """Whether they are the words of so many descriptors."""
        shapes_fit = self.centres.shape[1:] == (DESCRIPTOR_LENGTH,) and self.word_of_descriptor.shape == (descriptors,)
        return shapes_fit and int(self.word_of_descriptor.max(initial=0)) < len(self.centres)


def choose_words(descriptors: NDArray[np.uint8]) -> VisualWords:
    """Visual words of descriptors (D, 128): some of themselves. Means find no more landmarks."""
    count = max(1, min(len(descriptors) // _DESCRIPTORS_PER_WORD, _MOST_WORDS))
    centres = descriptors[np.linspace(0, len(descriptors) - 1, count).astype(np.int64)]
    return VisualWords(centres, assign_words(descriptors, centres))


def assign_words(descriptors: NDArray[np.uint8], centres: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """(M,) uint16 the word (W, 128) nearest to each descriptor (M, 128)."""
    vectors = centres.astype(np.float32)
    blocks = [
        _distances(descriptors[first : first + _BLOCK], vectors).argmin(axis=1)
        for first in range(0, len(descriptors), _BLOCK)
    ]
    return np.concatenate([np.zeros(0, np.int64), *blocks]).astype(np.uint16)


def _distances(descriptors: NDArray[np.uint8], centres: Vectors) -> Vectors:
    """(N, W) squared distances, less the squared length of the descriptors."""
    products = descriptors.astype(np.float32) @ centres.T
    return np.asarray(np.einsum("ij,ij->i", centres, centres) - 2.0 * products, np.float32)


class VisualIndex:
    """The descriptors of a map by their words; rows may be added or replaced.

    Args:
        descriptors: (D, 128) uint8 table that is read at every search.
        landmark_of_descriptor: (D,) uint32.
        words: of the first descriptors of the table; later rows are listed once they are added.
    """

    def __init__(
        self, descriptors: NDArray[np.uint8], landmark_of_descriptor: NDArray[np.uint32], words: VisualWords
    ) -> None:
        self._descriptors = as_bytes(descriptors)
        self._landmark_of_descriptor = np.require(landmark_of_descriptor, np.uint32, ("C", "A", "W", "E"))
        self._centres, self._vectors = words.centres, words.centres.astype(np.float32)
        self._unlisted = len(words.centres)
        self._word_of_descriptor = np.full(len(descriptors), self._unlisted, np.int32)
        self._word_of_descriptor[: len(words.word_of_descriptor)] = words.word_of_descriptor
        self._lists: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None

    def add(self, rows: NDArray[np.int64]) -> None:
        """List rows (N,) of the table whose descriptors are new."""
        self._word_of_descriptor[rows] = assign_words(self._descriptors[rows], self._centres)
        self._lists = None

    def find_nearest(
        self, descriptors: NDArray[np.uint8]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """The landmark most similar to each descriptor (M, 128), as of ``search_lists``."""
        if self._lists is None:
            order = np.argsort(self._word_of_descriptor, kind="stable")
            first = np.searchsorted(self._word_of_descriptor[order], np.arange(self._unlisted + 1))
            self._lists = order, first.astype(np.int64)
        probed = np.tile(np.arange(self._unlisted), (len(descriptors), 1))
        if self._unlisted > _PROBED:
            probed = np.argpartition(_distances(descriptors, self._vectors), _PROBED, axis=1)[:, :_PROBED]
        return search_lists(
            as_bytes(descriptors),
            np.ascontiguousarray(probed, np.int64),
            self._lists[1],
            self._lists[0],
            self._descriptors,
            self._landmark_of_descriptor,
        )
