"""Tags are found where a fisheye bends them, and their corners where its model puts them."""

import numpy as np
import pytest
from helpers.board_picture import board_picture, looking_at_origin, true_corners, two_by_two_board

from bodycam_ros.boards.apriltag import FAMILIES, detect_tags
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import exp_so3

LENSES = {"equidistant": [-0.0099, 0.0056, -0.0017, 0.0004], "fov": [0.95]}


def fisheye(model: str = "equidistant") -> CameraModel:
    k = [150.0, 0.0, 198.0, 0.0, 151.0, 152.0, 0.0, 0.0, 1.0]
    return camera_from_info("fisheye", 400, 300, model, LENSES[model], k)


def turned_away(place: tuple[float, float, float], angle_deg: float, about_deg: float) -> np.ndarray:
    """board_T_camera of a camera that sees the board so far from its axis."""
    pose = looking_at_origin(*place)
    about = np.radians(about_deg)
    pose[:3, :3] = pose[:3, :3] @ exp_so3(np.radians(angle_deg) * np.array([np.cos(about), np.sin(about), 0.0]))
    return pose


@pytest.mark.parametrize(
    ("model", "angle_deg", "about_deg"),
    [("equidistant", 20.0, 60.0), ("equidistant", 50.0, 80.0), ("fov", 40.0, 180.0)],
)
def test_corners_in_a_fisheye_picture_lie_where_the_lens_puts_them(
    model: str, angle_deg: float, about_deg: float
) -> None:
    camera, board = fisheye(model), two_by_two_board()
    pose = turned_away((0.1, -0.3, 0.4), angle_deg, about_deg)
    truth = true_corners(camera, pose, board)
    views = detect_tags(board_picture(camera, pose, board)[..., 0], camera, FAMILIES["36h11"])
    room = np.array([camera.width, camera.height])
    whole = {tag for tag, at in truth.items() if ((at > 6.0) & (at < room - 7.0)).all()}
    assert len(whole) >= 2
    assert {view.tag for view in views} >= whole
    errors = np.concatenate([view.corners - truth[view.tag] for view in views])
    assert np.linalg.norm(errors, axis=1).max() < 0.2
    assert np.median(np.linalg.norm(errors, axis=1)) < 0.06
