"""Where a lost camera may be: where a picture like its own was taken, or anywhere in the map.

pycolmap does it on the rays of our calibrated cameras, so a fisheye image needs no pinhole.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.colmap_model import PIXEL_SHIFT, colmap_camera, pycolmap
from bodycam_ros.geometry import inverse
from bodycam_ros.registration.matching import MatchingSettings, match_by_looks
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.settings import setting


@dataclass(frozen=True)
class AbsolutePoseSettings:
    """RANSAC of the absolute registration."""

    ransac_px: float = setting(
        3.0, unit="px", limits=(0.5, 20.0), reason="inlier threshold; the fit that follows tightens it"
    )
    ransac_min_inliers: int = setting(12, limits=(4, 500), reason="chance agreement of wrong matches stays below this")
    ransac_max_trials: int = setting(5000, limits=(100, 1_000_000), reason="finds 4 good matches among 85 % outliers")
    ransac_seed: int = setting(
        7, limits=(0, 2**31 - 1), reason="fixed, so that two runs over one recording are identical"
    )


def find_pose(
    camera: CameraModel,
    points_world: NDArray[np.floating],
    pixels: NDArray[np.floating],
    settings: AbsolutePoseSettings,
) -> NDArray[np.float64] | None:
    """PnP within LO-RANSAC on the camera's rays: world_T_camera (4, 4), or None when too few matches agree on one.

    Args:
        camera: of any model.
        points_world: (N, 3) [m].
        pixels: (N, 2) where the image shows them.
        settings: of the sampling.
    """
    options = pycolmap.AbsolutePoseEstimationOptions()
    options.ransac.max_error = settings.ransac_px
    options.ransac.max_num_trials = settings.ransac_max_trials
    options.ransac.random_seed = settings.ransac_seed
    found = pycolmap.estimate_absolute_pose(
        np.asarray(pixels, np.float64) + PIXEL_SHIFT,
        np.asarray(points_world, np.float64),
        colmap_camera(camera),
        options,
    )
    if found is None or np.sum(found["inlier_mask"]) < settings.ransac_min_inliers:
        return None
    return inverse(np.vstack([found["cam_from_world"].matrix(), [0.0, 0.0, 0.0, 1.0]]))


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
