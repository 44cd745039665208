"""What a camera knows of where it is."""

from dataclasses import replace

import numpy as np
import pytest

from bodycam_ros.registration.camera_sight import CameraSight, camera_sight
from bodycam_ros.registration.landmark_matches import LandmarkMatches

IDS = np.arange(10, dtype=np.uint32)
SEEN = LandmarkMatches(
    camera="head",
    stamp_ns=2,
    previous_stamp_ns=1,
    track_ids=IDS,
    landmark_ids=IDS,
    pixels=np.zeros((10, 2), np.float32),
    points_world=np.zeros((10, 3), np.float32),
    world_T_camera=np.eye(4),
    pose_covariance=np.eye(6),
    current_R_previous=np.eye(3),
    rotation_inliers=30,
)


@pytest.mark.parametrize(
    "matches, sight, label",
    [
        (SEEN, CameraSight.REGISTERED, "registered"),
        (replace(SEEN, grown=5), CameraSight.REGISTERED, "registered"),
        (replace(SEEN, grown=6), CameraSight.RELATIVE, "relative"),
        (replace(SEEN, world_T_camera=None), CameraSight.ROTATION_ONLY, "rotation only"),
        (replace(SEEN, world_T_camera=None, grown=6), CameraSight.ROTATION_ONLY, "rotation only"),
        (replace(SEEN, world_T_camera=None, rotation_inliers=0), CameraSight.BLIND, "blind"),
    ],
)
def test_what_is_known(matches: LandmarkMatches, sight: CameraSight, label: str) -> None:
    assert camera_sight(matches) is sight
    assert sight.label == label


def test_of_several_images_the_worst_is_the_greatest() -> None:
    assert max(CameraSight) is CameraSight.BLIND and min(CameraSight) is CameraSight.REGISTERED
