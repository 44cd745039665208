import numpy as np
import pytest
from helpers.board_picture import board_picture, looking_at_origin, true_corners, two_by_two_board, wide_camera

from bodycam_ros.boards.apriltag import FAMILIES, detect_tags

VIEWS = [(0.1, -0.5, 0.6), (0.5, 0.3, 0.5), (-0.3, 0.2, 0.9)]


@pytest.mark.parametrize("place", VIEWS)
@pytest.mark.parametrize("blur_px", [0.5, 1.0])
def test_corners_lie_where_the_edges_meet_whatever_the_blur(place, blur_px):
    camera, board, board_T_camera = wide_camera(), two_by_two_board(), looking_at_origin(*place)
    truth = true_corners(camera, board_T_camera, board)
    views = detect_tags(board_picture(camera, board_T_camera, board, blur_px)[..., 0], camera, FAMILIES["36h11"])
    assert {v.tag for v in views} == set(board.corners_board)
    errors = np.concatenate([v.corners - truth[v.tag] for v in views])
    assert np.linalg.norm(errors, axis=1).max() < 0.15
    # No pull towards the inside of the tags, which would make the board too small.
    inward = np.concatenate([truth[v.tag].mean(axis=0) - truth[v.tag] for v in views])
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    assert abs(np.sum(errors * inward, axis=1).mean()) < 0.03
