import cv2
import numpy as np
import pytest
from known_lenses import CHARUCO, LENSES
from rendered_board import held_poses, rendered

from bodycam_ros.mapping.apriltag import detect_tags


@pytest.mark.parametrize("model", ["plumb_bob", "equidistant"])
def test_blur_of_a_third_of_a_cell_does_not_move_the_sides_of_a_charuco_board_s_tags(model):
    camera = LENSES[model]
    poses = held_poses(camera, CHARUCO, 6, size=0.8)
    inset_px = {True: [], False: []}
    for pose, picture in zip(poses, rendered(camera, CHARUCO, poses, blur_px=1.2), strict=True):
        for is_known in inset_px:
            paper = CHARUCO.paper if is_known else None
            for view in detect_tags(picture, camera, CHARUCO.dictionary, 24.0, 0.3, paper):
                truth = camera.project(CHARUCO.tags[view.tag] @ pose[:3, :3].T + pose[:3, 3])[0]
                area = cv2.contourArea(truth.astype(np.float32)) - cv2.contourArea(view.corners.astype(np.float32))
                around = np.linalg.norm(np.roll(truth, -1, axis=0) - truth, axis=1).sum()
                inset_px[is_known].append(area / around)
    assert len(inset_px[True]) > 30
    assert np.abs(inset_px[True]).mean() < 0.015
    assert np.abs(inset_px[True]).mean() < 0.5 * np.abs(inset_px[False]).mean()
