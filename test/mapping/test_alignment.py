import numpy as np
import pytest
from helpers.board_picture import board_picture, looking_at_origin, true_corners, two_by_two_board, wide_camera
from helpers.naming import naming

from bodycam_ros.boards.apriltag import FAMILIES, TagView, detect_tags
from bodycam_ros.boards.board import Board
from bodycam_ros.errors import MapError
from bodycam_ros.geometry import exp_so3
from bodycam_ros.mapping.board_alignment import align_to_board

PLACES = [(0.1, -0.6, 0.7), (0.6, 0.3, 0.5), (-0.4, 0.2, 0.9), (-0.5, -0.4, 0.6), (0.2, 0.6, 0.8)]
# Structure from motion leaves scale and frame open: x_sfm = scale R x_board + t.
SCALE = 0.37
R = exp_so3(np.array([0.5, -1.1, 0.8]))
T = np.array([1.0, -2.0, 0.5])


def moved(board_T_camera):
    world_T_camera = board_T_camera.copy()
    world_T_camera[:, :3, :3] = R @ board_T_camera[:, :3, :3]
    world_T_camera[:, :3, 3] = SCALE * board_T_camera[:, :3, 3] @ R.T + T
    return world_T_camera


def exact_views(camera, board, poses):
    return [
        [TagView(tag, corners, np.array([80.0, 80.0])) for tag, corners in true_corners(camera, pose, board).items()]
        for pose in poses
    ]


@pytest.fixture(scope="module")
def scene():
    poses = np.array([looking_at_origin(*place) for place in PLACES])
    return wide_camera(), two_by_two_board(), poses


def assert_similarity(alignment, tolerance):
    assert alignment.scale * SCALE == pytest.approx(1.0, abs=tolerance)
    assert np.allclose(alignment.R @ R, np.eye(3), atol=tolerance)
    assert np.allclose(alignment.scale * alignment.R @ T + alignment.t, 0.0, atol=tolerance)


def test_exact_corners_give_the_similarity_back(scene):
    camera, board, poses = scene
    alignment = align_to_board(moved(poses), exact_views(camera, board, poses), [camera] * len(poses), board)
    assert_similarity(alignment, 1e-6)
    assert alignment.residual.rms_px < 1e-4
    assert alignment.residual.views_of_tag == {tag: len(PLACES) for tag in range(4)}


def test_pictures_give_scale_and_tilt_even_if_gamma_moves_the_edges(scene):
    camera, board, poses = scene
    views = [
        detect_tags(board_picture(camera, pose, board, 1.2, gamma=2.2)[..., 0], camera, FAMILIES["36h11"])
        for pose in poses[:3]
    ]
    alignment = align_to_board(moved(poses[:3]), views, [camera] * 3, board)
    assert_similarity(alignment, 1e-3)
    assert alignment.residual.inset_px > 0.1


def test_the_upward_axis_of_a_standing_board_becomes_z(scene):
    camera, board, poses = scene
    standing = Board(board.family, board.corners_board, np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
    alignment = align_to_board(moved(poses), exact_views(camera, board, poses), [camera] * len(poses), standing)
    up_in_sfm = R @ [0.0, 1.0, 0.0]
    assert np.allclose(alignment.R @ up_in_sfm, [0.0, 0.0, 1.0], atol=1e-6)
    assert np.array_equal(alignment.map_R_board, standing.map_R_board)


def test_tags_of_another_board_are_an_error(scene):
    camera, board, poses = scene
    views = [[TagView(77, v.corners, v.breadths) for v in seen] for seen in exact_views(camera, board, poses)]
    with naming(MapError, "36h11: 0, 1, 2, 3"):
        align_to_board(moved(poses), views, [camera] * len(poses), board)
