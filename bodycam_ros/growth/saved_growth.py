"""What has grown in an earlier run, read back from the map that ``GrowingMap.settled`` made."""

from pathlib import Path

import numpy as np

from bodycam_ros.errors import MapError
from bodycam_ros.growth.growing_map import LOOKS, GrownLandmarks
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.keypoints import DESCRIPTOR_LENGTH


def load_growth(path: Path, reference_map: ReferenceMap, map_path: Path) -> GrownLandmarks:
    """The landmarks of a saved map that its reference map has not.

    Args:
        path: folder of the saved map.
        reference_map: what it must have grown from.
        map_path: its folder, for messages.

    Raises:
        MapError: the saved map is damaged, or has grown from another one.
    """
    saved, settled = ReferenceMap.load(path), len(reference_map.landmark_ids)
    # A landmark that was placed anew is another one, whatever its id.
    same = np.array_equal(saved.landmark_ids[:settled], reference_map.landmark_ids) and np.array_equal(
        saved.points_world[:settled], reference_map.points_world
    )
    if not same:
        raise MapError(
            f"{path}: this map has grown from another one than {map_path}; give the map that it has grown from, or "
            "another folder for what grows, or remove this one"
        )
    return _behind(saved, settled)


def _behind(saved: ReferenceMap, settled: int) -> GrownLandmarks:
    """The landmarks from a row on, each with its first looks."""
    count = len(saved.landmark_ids) - settled
    landmark = saved.descriptor_landmark.astype(np.int64)
    which = np.arange(len(landmark)) - np.searchsorted(landmark, landmark)
    looks = np.flatnonzero((landmark >= settled) & (which < LOOKS))
    at = landmark[looks] - settled, which[looks]
    descriptors = np.zeros((count, LOOKS, DESCRIPTOR_LENGTH), np.uint8)
    views, sizes = np.zeros((count, LOOKS, 3), np.float32), np.zeros((count, LOOKS), np.float32)
    descriptors[at], views[at], sizes[at] = (
        saved.descriptors[looks],
        saved.descriptor_view[looks],
        saved.descriptor_size[looks],
    )
    points, ids = saved.points_world[settled:].copy(), saved.landmark_ids[settled:].copy()
    return GrownLandmarks(np.arange(count), ids, points, descriptors, views, sizes)
