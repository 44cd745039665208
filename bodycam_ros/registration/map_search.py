"""How a map is asked what a picture shows, by descriptors alone: similar places, and an index of all landmarks.

Made when a camera is lost for the first time; all cameras of a process share it.
"""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.kernels import as_rows
from bodycam_ros.registration.giver_kernels import givers_of_looks
from bodycam_ros.registration.landmark_index import LandmarkIndex
from bodycam_ros.registration.map_photographs import MapPhotographs
from bodycam_ros.registration.place_memory import PlaceMemory
from bodycam_ros.registration.visual_words import VisualWords


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
