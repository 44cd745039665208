"""Where a lost camera may be: where a picture like its own was taken, or anywhere in the map."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.registration.absolute_pose import find_pose
from bodycam_ros.registration.absolute_pose_settings import AbsolutePoseSettings
from bodycam_ros.registration.matching import MatchingSettings, match_by_looks
from bodycam_ros.registration.reference_map import ReferenceMap

Matches = tuple[NDArray[np.int64], NDArray[np.int64]]


class LostCamera:
    """Looks for one camera.

    Args:
        camera, reference_map: its model; the map.
        matching, absolute_pose: settings of the search and of its RANSAC.
    """

    def __init__(
        self,
        camera: CameraModel,
        reference_map: ReferenceMap,
        matching: MatchingSettings,
        absolute_pose: AbsolutePoseSettings,
    ) -> None:
        self._camera, self._map = camera, reference_map
        self._matching, self._absolute_pose = matching, absolute_pose

    def poses(
        self,
        pixels: NDArray[np.float64],
        descriptors: NDArray[np.uint8],
        scales: NDArray[np.floating],
    ) -> Iterator[NDArray[np.float64]]:
        """Poses world_T_camera (4, 4) that the camera may have, the likeliest first; each costs when it is asked for.

        Args:
            pixels, descriptors, scales: (M, 2), (M, 128), (M,) its keypoints, the strongest first.
        """
        for matches in self._alike(descriptors):
            found = self._pose(pixels, matches)
            if found is not None:
                yield found

    def _alike(self, descriptors: NDArray[np.uint8]) -> Iterator[Matches]:
        """Keypoints and landmarks that look alike: of similar photographs, then of the whole map."""
        places = self._map.search.places
        if len(places) > self._matching.similar_places:
            similar = places.similar(descriptors, self._matching.similar_places)
            yield match_by_looks(self._map, descriptors, places.seen_from(similar), self._matching)
        yield match_by_looks(self._map, descriptors, None, self._matching)

    def _pose(self, pixels: NDArray[np.float64], matches: Matches) -> NDArray[np.float64] | None:
        """The pose that enough of these matches agree on."""
        named, landmarks = matches
        if len(named) < self._absolute_pose.ransac_min_inliers:
            return None
        return find_pose(self._camera, self._map.points_world[landmarks], pixels[named], self._absolute_pose)
