"""Search of a map by descriptors alone: an inverted file of visual words, and similar photographs.

An inverted file (Sivic and Zisserman 2003): descriptors are listed by their visual word, and a query is compared with
those in the lists of the words nearest to it, byte by byte. Photographs are compared by their words, weighted by how
rare each is (tf-idf).

``bodycam map`` makes the words once and saves them with the map; a map without them makes them when a camera is lost
for the first time. The same map always gives the same words.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import as_bytes
from bodycam_ros.registration.descriptor_kernels import search_lists
from bodycam_ros.tracking.keypoints import DESCRIPTOR_LENGTH

_DESCRIPTORS_PER_WORD = 80  # of a map; more make a search slower, fewer make it miss more
_MOST_WORDS = 2048
_SAMPLES_PER_WORD = 16  # descriptors that a mean is made of
_ROUNDS = 6  # of k-means
_BLOCK = 16384  # descriptors assigned together
_PROBED = 8  # lists searched for a descriptor; they contain 56 of the 60 landmarks that all lists give
_SIMILAR = 20  # photographs; with 10 a camera in 60 is found only in the whole map

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


def cluster_words(descriptors: NDArray[np.uint8]) -> VisualWords:
    """Visual words of descriptors (D, 128), by k-means on a sample."""
    count = max(1, min(len(descriptors) // _DESCRIPTORS_PER_WORD, _MOST_WORDS))
    rows = np.linspace(0, len(descriptors) - 1, min(len(descriptors), _SAMPLES_PER_WORD * count)).astype(np.int64)
    sample = descriptors[rows].astype(np.float32)
    centres = sample[np.linspace(0, len(sample) - 1, count).astype(np.int64)]
    for _ in range(_ROUNDS):
        word = _distances(sample, centres).argmin(axis=1)
        order = np.argsort(word, kind="stable")
        present, first = np.unique(word[order], return_index=True)
        sums = np.add.reduceat(sample[order], first, axis=0)
        centres[present] = sums / np.diff(first, append=len(sample))[:, None]
    rounded = np.rint(centres).astype(np.uint8)
    return VisualWords(rounded, assign_words(descriptors, rounded))


def assign_words(descriptors: NDArray[np.uint8], centres: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """(M,) uint16 the word (W, 128) nearest to each descriptor (M, 128)."""
    vectors = centres.astype(np.float32)
    blocks = [
        _distances(descriptors[first : first + _BLOCK].astype(np.float32), vectors).argmin(axis=1)
        for first in range(0, len(descriptors), _BLOCK)
    ]
    return np.concatenate([np.zeros(0, np.int64), *blocks]).astype(np.uint16)


def _distances(vectors: Vectors, centres: Vectors) -> Vectors:
    """(N, W) squared distances, less the squared length of the vectors."""
    return np.asarray(np.einsum("ij,ij->i", centres, centres) - 2.0 * (vectors @ centres.T), np.float32)


class VisualIndex:
    """The descriptors of a map by their words; rows may be added or replaced.

    Args:
        descriptors: (D, 128) uint8 table that is read at every search.
        landmark_of_descriptor: (D,) uint32.
        words: of the first descriptors of the table; later rows are listed once they are added.
        landmarks: number of landmarks.
        observations: (O,) landmarks and (O,) photographs that show them; empty for a map without photographs.
        photographs: number of photographs.
    """

    def __init__(
        self,
        descriptors: NDArray[np.uint8],
        landmark_of_descriptor: NDArray[np.uint32],
        words: VisualWords,
        landmarks: int,
        observations: tuple[NDArray[np.integer], NDArray[np.integer]],
        photographs: int,
    ) -> None:
        self._descriptors = as_bytes(descriptors)
        self._landmark_of_descriptor = np.require(landmark_of_descriptor, np.uint32, ("C", "A", "W", "E"))
        self._centres, self._landmarks = words.centres, landmarks
        self._vectors = words.centres.astype(np.float32)
        self._unlisted = len(words.centres)
        self._word_of_descriptor = np.full(len(descriptors), self._unlisted, np.int32)
        self._word_of_descriptor[: len(words.word_of_descriptor)] = words.word_of_descriptor
        self._lists: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None
        self._observations = observations
        self._bags, self._rarity = self._describe_photographs(photographs)

    def add(self, rows: NDArray[np.int64]) -> None:
        """List rows (N,) of the table whose descriptors are new."""
        self._word_of_descriptor[rows] = assign_words(self._descriptors[rows], self._centres)
        self._lists = None

    def find_similar(self, descriptors: NDArray[np.uint8]) -> NDArray[np.bool_] | None:
        """(L,) which landmarks are in the photographs most similar to an image with these descriptors (M, 128).

        None where there are no more photographs than are compared.
        """
        if len(self._bags) <= _SIMILAR:
            return None
        bag = np.bincount(assign_words(descriptors, self._centres), minlength=self._unlisted)
        likeness = self._bags @ _unit_rows(np.sqrt(bag)[None] * self._rarity)[0]
        similar = np.zeros(len(self._bags), bool)
        similar[np.argsort(-likeness, kind="stable")[:_SIMILAR]] = True
        allowed = np.zeros(self._landmarks, bool)
        landmarks, photographs = self._observations
        allowed[landmarks[similar[photographs]]] = True
        return allowed

    def find_nearest(
        self, descriptors: NDArray[np.uint8], allowed: NDArray[np.bool_] | None = None
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """The landmark most similar to each descriptor.

        Args:
            descriptors: (M, 128) uint8.
            allowed: (L,) landmarks that may be found; None: all.

        Returns:
            Landmarks (M,), -1 where there is none, and the distances (M,) to each and to the next landmark; absent
            ones are farther than all others.
        """
        if self._lists is None:
            order = np.argsort(self._word_of_descriptor, kind="stable")
            first = np.searchsorted(self._word_of_descriptor[order], np.arange(self._unlisted + 1))
            self._lists = order, first.astype(np.int64)
        distances = _distances(descriptors.astype(np.float32), self._vectors)
        probed = np.tile(np.arange(self._unlisted), (len(descriptors), 1))
        if self._unlisted > _PROBED:
            probed = np.argpartition(distances, _PROBED, axis=1)[:, :_PROBED]
        landmarks, nearest, second = search_lists(
            as_bytes(descriptors),
            np.ascontiguousarray(probed, np.int64),
            self._lists[1],
            self._lists[0],
            self._descriptors,
            self._landmark_of_descriptor,
            np.ones(self._landmarks, bool) if allowed is None else allowed,
        )
        return landmarks, np.sqrt(nearest), np.sqrt(second)

    def _describe_photographs(self, count: int) -> tuple[Vectors, Vectors]:
        """Unit rows (K, W) of weighted words of the photographs, and the weight (W,) of each word."""
        landmarks, photographs = self._observations
        present = np.flatnonzero(self._word_of_descriptor < self._unlisted)
        # Each observation has all words of its landmark; a map's descriptors ascend by landmark.
        owner = self._landmark_of_descriptor[present]
        first, last = np.searchsorted(owner, landmarks), np.searchsorted(owner, landmarks, side="right")
        counts = last - first
        rows = present[np.arange(counts.sum()) + np.repeat(first - (np.cumsum(counts) - counts), counts)]
        cells = np.repeat(photographs.astype(np.int64), counts) * self._unlisted + self._word_of_descriptor[rows]
        bags = np.bincount(cells, minlength=count * self._unlisted).reshape(count, self._unlisted)
        rarity = np.log((1.0 + count) / (1.0 + (bags > 0).sum(axis=0))).astype(np.float32)
        return _unit_rows(np.sqrt(bags) * rarity), rarity


def _unit_rows(rows: NDArray[np.floating]) -> Vectors:
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-9), np.float32)
