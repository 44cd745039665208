"""Which keyframe is a picture most like: places compared by one vector each.

The vector is a VLAD (Jegou et al. 2010): of every visual word, the mean direction in which the descriptors of that word
deviate from it.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.registration.visual_words import VisualWords

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
