"""Visual words: kinds of descriptors, coarse and fine, learned from a map's own.

They are what places are compared by, and the lists of the landmarks' index. K-means on a sample, on two levels; from
the same map come the same words.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.tracking.keypoints import DESCRIPTOR_LENGTH

Vectors = NDArray[np.float32]

WORDS = 64
_LOOKS_PER_LIST = 80
_MOST_FINE = 64  # more would take longer to learn than they save
_COARSE_SAMPLE = 64  # descriptors for each word to be learned; a mean of some dozens is where it will be
_FINE_SAMPLE = 16
_ROUNDS = 6
_BLOCK = 65536
_PROBED_WORDS = 8
_NOWHERE = 1e4  # beyond all descriptors


@dataclass(frozen=True)
class VisualWords:
    """Words and, of each, finer ones: the lists.

    Attributes:
        centres: (W, 128) float32.
        fine: (W, B, 128) float32; list ``w * B + b`` is of the descriptors nearest to ``fine[w, b]`` of those nearest
            to ``centres[w]``.
    """

    centres: Vectors
    fine: Vectors

    @classmethod
    def learn(cls, descriptors: NDArray[np.uint8]) -> "VisualWords":
        """From descriptors (D, 128), of which a sample is looked at."""
        count = len(descriptors)
        fine = int(np.clip(round(count / (WORDS * _LOOKS_PER_LIST)), 1, _MOST_FINE))
        sample = descriptors[_spread(count, WORDS * max(_COARSE_SAMPLE, _FINE_SAMPLE * fine))].astype(np.float32)
        centres = _means(sample[_spread(len(sample), WORDS * _COARSE_SAMPLE)], WORDS)
        word = _nearest(sample, centres)
        return cls(centres, np.stack([_means(sample[word == w], fine) for w in range(WORDS)]))

    @property
    def lists(self) -> int:
        """How many lists there are."""
        return int(self.fine.shape[0] * self.fine.shape[1])

    def words_of(self, descriptors: NDArray[np.uint8]) -> NDArray[np.int64]:
        """(M,) the word of each descriptor (M, 128)."""
        blocks = (descriptors[i : i + _BLOCK].astype(np.float32) for i in range(0, len(descriptors), _BLOCK))
        return np.concatenate([np.zeros(0, np.int64), *(_nearest(block, self.centres) for block in blocks)])

    def list_of(self, descriptors: NDArray[np.uint8], words: NDArray[np.int64]) -> NDArray[np.int64]:
        """(M,) the list that each descriptor (M, 128) of these words belongs into."""
        lists: NDArray[np.int64] = words * self.fine.shape[1]
        by_word = np.argsort(words, kind="stable")
        ends = np.searchsorted(words[by_word], np.arange(len(self.centres) + 1))
        for w in range(len(self.centres)):
            rows = by_word[ends[w] : ends[w + 1]]
            lists[rows] += _nearest(descriptors[rows].astype(np.float32), self.fine[w])
        return lists

    def lists_near(self, descriptors: NDArray[np.uint8], count: int) -> NDArray[np.int64]:
        """(M, P) the lists that hold what is most like each descriptor (M, 128): so many, or all there are."""
        vectors = descriptors.astype(np.float32)
        likely = _least(_distances(vectors, self.centres), _PROBED_WORDS)
        fine = self.fine.shape[1]
        distances = np.empty((*likely.shape, fine), np.float32)
        for w in range(len(self.centres)):
            rows, places = np.nonzero(likely == w)
            distances[rows, places] = _distances(vectors[rows], self.fine[w])
        lists = (likely[:, :, None] * fine + np.arange(fine)).reshape(len(vectors), likely.shape[1] * fine)
        best = _least(distances.reshape(lists.shape), count)
        return np.ascontiguousarray(np.take_along_axis(lists, best, axis=1), np.int64)


def _spread(rows: int, count: int) -> NDArray[np.int64]:
    """So many of the rows, evenly; all if there are fewer."""
    return np.arange(rows) if rows <= count else np.linspace(0, rows - 1, count).astype(np.int64)


def _means(vectors: Vectors, count: int) -> Vectors:
    """(count, 128) K-means of vectors (N, 128), begun at some of them; with fewer vectors the others are nowhere."""
    if len(vectors) <= count:
        return np.concatenate([vectors, np.full((count - len(vectors), DESCRIPTOR_LENGTH), _NOWHERE, np.float32)])
    centres = vectors[_spread(len(vectors), count)]
    for _ in range(_ROUNDS):
        members = np.zeros((count, len(vectors)), np.float32)
        members[_nearest(vectors, centres), np.arange(len(vectors))] = 1.0
        sizes = members.sum(axis=1, keepdims=True)
        centres = np.where(sizes > 0, (members @ vectors) / np.maximum(sizes, 1.0), centres)
    return centres


def _distances(vectors: Vectors, centres: Vectors) -> Vectors:
    """(N, C) squared, less the vectors' own length."""
    return np.asarray(np.einsum("ij,ij->i", centres, centres) - 2.0 * (vectors @ centres.T), np.float32)


def _nearest(vectors: Vectors, centres: Vectors) -> NDArray[np.int64]:
    return np.asarray(np.argmin(_distances(vectors, centres), axis=1), np.int64)


def _least(distances: Vectors, count: int) -> NDArray[np.int64]:
    """(N, count) columns of the least of each row, in no order; all if there are no more."""
    if count >= distances.shape[1]:
        return np.tile(np.arange(distances.shape[1]), (len(distances), 1))
    return np.argpartition(distances, count, axis=1)[:, :count]
